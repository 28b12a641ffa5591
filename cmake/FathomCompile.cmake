# How our own code is compiled: include root, warnings, sanitizers, ccache.

# -fsanitize value of the asan and tsan presets; applied to every target,
# generated ones too, because a sanitizer must see the whole program.
set(FATHOM_SANITIZE "" CACHE STRING
    "Comma-separated value for -fsanitize; empty for none")
if(FATHOM_SANITIZE)
  add_compile_options(-fsanitize=${FATHOM_SANITIZE} -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${FATHOM_SANITIZE})
endif()

# The preset `fuzz`: programs of tests/fuzz are linked with libFuzzer.
option(FATHOM_FUZZ "Build the fuzz targets to search, with clang" OFF)

if(NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(FATHOM_CCACHE ccache)
  mark_as_advanced(FATHOM_CCACHE)
  if(FATHOM_CCACHE)
    set(CMAKE_C_COMPILER_LAUNCHER ${FATHOM_CCACHE})
    set(CMAKE_CXX_COMPILER_LAUNCHER ${FATHOM_CCACHE})
  endif()
endif()

# Two links at a time at most: a link against gRPC needs near 1 GB with -g.
set_property(GLOBAL PROPERTY JOB_POOLS link_pool=2)
set(CMAKE_JOB_POOL_LINK link_pool)

# Link this PUBLIC into a room's library: #include paths start at the root.
add_library(fathom_includes INTERFACE)
target_include_directories(fathom_includes INTERFACE
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:include/fathom>)

# Link this PRIVATE into everything we wrote, never into generated code.
add_library(fathom_warnings INTERFACE)
target_compile_options(fathom_warnings INTERFACE
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror
    # g++ 12 reports std::string operator+ falsely (GCC bug 105651).
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
    $<$<CXX_COMPILER_ID:Clang>:-Wthread-safety>)
if(FATHOM_SANITIZE)
  # g++ does not follow definitions through sanitizer instrumentation.
  target_compile_options(fathom_warnings INTERFACE
      $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endif()

# fathom_add_library(<name> SOURCES <file>... [PUBLIC <lib>...]
#                    [PRIVATE <lib>...])
#
# A static library of our own code, with our include root and our warnings. A
# library without sources (headers only) becomes an INTERFACE library.
function(fathom_add_library name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "" "SOURCES;PUBLIC;PRIVATE")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR
        "fathom_add_library(${name}): unknown ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  if(ARG_SOURCES)
    add_library(${name} STATIC ${ARG_SOURCES})
    target_link_libraries(${name}
        PUBLIC fathom_includes ${ARG_PUBLIC}
        PRIVATE $<BUILD_INTERFACE:fathom_warnings> ${ARG_PRIVATE})
  else()
    add_library(${name} INTERFACE)
    target_link_libraries(${name}
        INTERFACE fathom_includes ${ARG_PUBLIC} ${ARG_PRIVATE})
  endif()
endfunction()

# fathom_add_executable(<name> SOURCES <file>... [LIBS <lib>...]
#                       [OUTPUT <file name>])
function(fathom_add_executable name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "OUTPUT" "SOURCES;LIBS")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR
        "fathom_add_executable(${name}): unknown ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name}
      PRIVATE fathom_includes fathom_warnings ${ARG_LIBS})
  if(ARG_OUTPUT)
    set_target_properties(${name} PROPERTIES OUTPUT_NAME ${ARG_OUTPUT})
  endif()
endfunction()
