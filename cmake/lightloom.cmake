# Flags every target shares, the packages, and the one way to declare a module.

find_program(CCACHE ccache)
if(CCACHE)
  # What ccache asks for where headers are precompiled.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE})
endif()

# Stored values must not depend on how the compiler contracts a*b+c (docs/adr/0001-determinism.md).
add_compile_options(-ffp-contract=off)

if(LIGHTLOOM_SANITIZE)
  add_compile_options(-fsanitize=${LIGHTLOOM_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=${LIGHTLOOM_SANITIZE})
  if(LIGHTLOOM_SANITIZE MATCHES "thread" AND CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    # The old spelling of -fsanitize-ignorelist: ccache hashes the contents of the file with this one only.
    add_compile_options(-fsanitize-blacklist=${PROJECT_SOURCE_DIR}/tests/sanitizers/tsan.ignorelist)
  endif()
endif()

find_package(Threads REQUIRED)
find_package(absl CONFIG REQUIRED)
find_package(embree 3 CONFIG REQUIRED)
find_package(Eigen3 3.4 CONFIG REQUIRED)
find_package(Protobuf REQUIRED)
find_package(gRPC CONFIG REQUIRED)
find_package(OpenEXR 3 CONFIG REQUIRED)
find_package(OpenSSL REQUIRED)
find_package(TinyGLTF CONFIG REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(spdlog CONFIG REQUIRED)
find_package(CLI11 CONFIG REQUIRED)
find_package(Vulkan REQUIRED)
find_package(ZLIB REQUIRED)
find_package(SQLite3 REQUIRED)
find_program(GRPC_CPP_PLUGIN grpc_cpp_plugin REQUIRED)

# lightloom_quick_build(<cpp>...)
# For parsing and plumbing, where seconds of compilation buy no speed: heavy headers, -O1.
function(lightloom_quick_build)
  set_property(SOURCE ${ARGN} APPEND PROPERTY COMPILE_OPTIONS $<$<CONFIG:Release>:-O1>)
endfunction()

# lightloom_module(<name> SOURCES <cpp>... [PUBLIC <targets>...] [PRIVATE <targets>...])
# A static library named lightloom_<name>, whose headers are included by their path from the root of the repository.
# PUBLIC names what its headers show, PRIVATE what only its .cpp files use; tests/link_rules checks both lists.
function(lightloom_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(lightloom_${name} STATIC ${ARG_SOURCES})
  target_include_directories(lightloom_${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_compile_options(lightloom_${name} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Werror>)
  target_link_libraries(lightloom_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
endfunction()
