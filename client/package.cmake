# The client library as a package for other people's programs:
#
#   cmake --install build/release --component client --prefix /usr/local
#
#   find_package(fathom 0.1 REQUIRED)
#   target_link_libraries(planner PRIVATE fathom::client)
#
# Headers lie under include/fathom, which is their include root
# ("client/client.h", "fathom/v1/types.pb.h"), so that they meet no other
# package's; the contract for other languages under share/fathom/proto.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_targets fathom_client fathom_base fathom_proto
    fathom_foreign_proto fathom_includes)
foreach(target IN LISTS package_targets)
  string(REPLACE fathom_ "" exported ${target})
  add_library(fathom::${exported} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${exported})
endforeach()
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/fathom)
install(TARGETS ${package_targets} EXPORT fathom
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client)
install(EXPORT fathom NAMESPACE fathom:: FILE fathom-targets.cmake
    DESTINATION ${package_dir} COMPONENT client)
write_basic_package_version_file(
    ${CMAKE_CURRENT_BINARY_DIR}/fathom-config-version.cmake
    COMPATIBILITY SameMinorVersion)
install(FILES fathom-config.cmake
    ${CMAKE_CURRENT_BINARY_DIR}/fathom-config-version.cmake
    DESTINATION ${package_dir} COMPONENT client)

foreach(room IN ITEMS base client)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${room}
      DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/fathom COMPONENT client
      FILES_MATCHING PATTERN "*.h"
      PATTERN cli EXCLUDE
      PATTERN examples EXCLUDE)
endforeach()
install(DIRECTORY ${PROJECT_BINARY_DIR}/proto/gen/
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/fathom COMPONENT client
    FILES_MATCHING PATTERN "*.h")
install(DIRECTORY ${PROJECT_SOURCE_DIR}/proto/fathom
    DESTINATION ${CMAKE_INSTALL_DATADIR}/fathom/proto COMPONENT client
    FILES_MATCHING PATTERN "*.proto")
