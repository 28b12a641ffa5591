# Every outside package, found once, with the target name that a room links.
#
#   absl::status absl::statusor absl::str_format ...   everywhere
#   Eigen3::Eigen                map
#   GeographicLib::GeographicLib map/geodesy only
#   SQLite::SQLite3, fathom_zstd, Boost::headers       storage only
#   protobuf::libprotobuf gRPC::grpc++ gRPC::grpc++_reflection  (fathom_proto)
#   GDAL::GDAL fathom_cairo      client command line, sim_feeder, tests
#   CLI11::CLI11 spdlog::spdlog nlohmann_json::nlohmann_json yaml-cpp
#   GTest::gtest_main GTest::gmock benchmark::benchmark_main   tests
#
# All includes are SYSTEM ones: our warnings are not for other people's code.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(absl CONFIG REQUIRED)
find_package(Protobuf REQUIRED)
find_package(gRPC CONFIG REQUIRED)
find_package(SQLite3 REQUIRED)
find_package(Boost REQUIRED)  # Headers only: Boost.CRC for CRC-32C.
find_package(Eigen3 CONFIG REQUIRED)
find_package(GDAL CONFIG REQUIRED)
find_package(yaml-cpp CONFIG REQUIRED)
find_package(CLI11 CONFIG REQUIRED)
find_package(spdlog CONFIG REQUIRED)
find_package(nlohmann_json CONFIG REQUIRED)
pkg_check_modules(fathom_pc_zstd REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(fathom_pc_cairo REQUIRED IMPORTED_TARGET cairo)

add_library(fathom_zstd INTERFACE)
target_link_libraries(fathom_zstd INTERFACE PkgConfig::fathom_pc_zstd)
add_library(fathom_cairo INTERFACE)
target_link_libraries(fathom_cairo INTERFACE PkgConfig::fathom_pc_cairo)

# Debian ships GeographicLib's find module outside CMake's default path; it
# defines variables, not a target.
list(APPEND CMAKE_MODULE_PATH /usr/share/cmake/geographiclib)
find_package(GeographicLib MODULE REQUIRED)
if(NOT TARGET GeographicLib::GeographicLib)
  add_library(GeographicLib::GeographicLib UNKNOWN IMPORTED)
  set_target_properties(GeographicLib::GeographicLib PROPERTIES
      IMPORTED_LOCATION ${GeographicLib_LIBRARIES}
      INTERFACE_INCLUDE_DIRECTORIES ${GeographicLib_INCLUDE_DIRS})
endif()

if(BUILD_TESTING OR NOT DEFINED BUILD_TESTING)
  find_package(GTest CONFIG REQUIRED)
  find_package(benchmark CONFIG REQUIRED)
endif()

# Test tools in Python use Debian's interpreter: python3-grpcio and
# python3-protobuf belong to it, not to whatever python3 is first in PATH.
find_program(FATHOM_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH REQUIRED)
