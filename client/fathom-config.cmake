# find_package(fathom): fathom::client and what it links, all of it Debian's.
include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(absl CONFIG)
find_dependency(Protobuf)
find_dependency(gRPC CONFIG)
find_dependency(spdlog CONFIG)
include(${CMAKE_CURRENT_LIST_DIR}/fathom-targets.cmake)
