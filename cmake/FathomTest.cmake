# Tests: one binary, one ctest entry, at least one label.

# Where real survey and contact recordings are. The folder lies beside the
# project root and is optional: a test that needs it prints why it skips.
set(FATHOM_SHARED_DATA_DIR ${PROJECT_SOURCE_DIR}/../shared/data CACHE PATH
    "Folder of shared survey recordings; may be absent")

# Build every test with one of these labels: fathom_tests_quick,
# fathom_tests_tsan, ...
set(fathom_test_labels quick integration tsan slow fault fuzz)
foreach(label IN LISTS fathom_test_labels)
  add_custom_target(fathom_tests_${label})
endforeach()

# Gives `source` the absolute paths that it names, as string literals.
function(fathom_define_paths source)
  get_filename_component(path ${source} ABSOLUTE)
  if(NOT EXISTS ${path})
    return()  # Generated later: no paths.
  endif()
  # Configure again when the source changes, since it may name another path.
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${path})
  set(FATHOM_SOURCE_DIR ${PROJECT_SOURCE_DIR})
  set(FATHOM_BINARY_DIR ${PROJECT_BINARY_DIR})
  foreach(name IN ITEMS
      FATHOM_SHARED_DATA_DIR FATHOM_SOURCE_DIR FATHOM_BINARY_DIR)
    file(STRINGS ${path} found REGEX ${name} LIMIT_COUNT 1)
    if(found)
      set_property(SOURCE ${source} APPEND PROPERTY
          COMPILE_DEFINITIONS "${name}=\"${${name}}\"")
    endif()
  endforeach()
endfunction()

# fathom_add_test(NAME <name> SOURCES <file>... [LIBS <lib>...]
#                 [LABELS <label>...] [TIMEOUT <seconds>]
#                 [NO_MAIN])
#
# A GoogleTest binary that ctest runs as one entry (starting a process per
# TEST costs more than the tests). Labels: quick, integration, tsan, slow,
# fault, fuzz. A test is `quick` unless it is integration, slow, fault or
# fuzz; `tsan` marks gRPC-free concurrent classes and is added to quick.
# A source that names FATHOM_SHARED_DATA_DIR, FATHOM_SOURCE_DIR or
# FATHOM_BINARY_DIR sees it as a string literal; other sources do not, so that
# their objects are the same in every clone and ccache serves them. TIMEOUT defaults to 120 s, doubled under a sanitizer.
# NO_MAIN leaves main() to the sources.
function(fathom_add_test)
  cmake_parse_arguments(PARSE_ARGV 0 ARG
      "NO_MAIN" "NAME;TIMEOUT" "SOURCES;LIBS;LABELS")
  if(ARG_UNPARSED_ARGUMENTS OR NOT ARG_NAME OR NOT ARG_SOURCES)
    message(FATAL_ERROR
        "fathom_add_test(${ARG_NAME}): unknown ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  foreach(label IN LISTS ARG_LABELS)
    if(NOT label IN_LIST fathom_test_labels)
      message(FATAL_ERROR "fathom_add_test(${ARG_NAME}): label ${label} is "
          "not one of ${fathom_test_labels}")
    endif()
  endforeach()
  set(heavy ${ARG_LABELS})
  list(REMOVE_ITEM heavy quick tsan)
  if(NOT heavy)
    list(APPEND ARG_LABELS quick)
    list(REMOVE_DUPLICATES ARG_LABELS)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  if(FATHOM_SANITIZE)
    math(EXPR ARG_TIMEOUT "${ARG_TIMEOUT} * 2")
  endif()

  add_executable(${ARG_NAME} ${ARG_SOURCES})
  target_link_libraries(${ARG_NAME} PRIVATE
      fathom_includes fathom_warnings ${ARG_LIBS} GTest::gmock GTest::gtest)
  if(NOT ARG_NO_MAIN)
    target_link_libraries(${ARG_NAME} PRIVATE GTest::gtest_main)
  endif()
  foreach(source IN LISTS ARG_SOURCES)
    fathom_define_paths(${source})
  endforeach()
  add_test(NAME ${ARG_NAME} COMMAND ${ARG_NAME} --gtest_brief=1)
  set_tests_properties(${ARG_NAME} PROPERTIES
      LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
  foreach(label IN LISTS ARG_LABELS)
    add_dependencies(fathom_tests_${label} ${ARG_NAME})
  endforeach()
endfunction()
