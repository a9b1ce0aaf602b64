# Flags every target shares, the packages, and the one way to declare a module.

find_program(CCACHE ccache)
if(CCACHE)
  # What ccache asks for where headers are precompiled.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE})
endif()

# In every file, since gRPC's targets bring it to some: precompiled headers want the same flags.
add_compile_options(-pthread)

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
find_package(PostgreSQL REQUIRED)  # libpq
find_package(SQLite3 REQUIRED)
find_package(glfw3 3.3 CONFIG REQUIRED)
find_program(GRPC_CPP_PLUGIN grpc_cpp_plugin REQUIRED)

# Dear ImGui comes without a CMake package, and takes its fonts from stb.
find_library(IMGUI_LIBRARY imgui REQUIRED)
find_path(IMGUI_INCLUDE imgui.h PATH_SUFFIXES imgui REQUIRED)
add_library(imgui STATIC IMPORTED)
set_target_properties(imgui PROPERTIES IMPORTED_LOCATION ${IMGUI_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${IMGUI_INCLUDE}
  INTERFACE_LINK_LIBRARIES "stb;glfw;Vulkan::Vulkan")

# lightloom_flavour(<name> [PIC] [OPTIONS <flag>...] [HEADERS <header>...])
# One way to compile, and what nearly every file reads, compiled once for it: the headers below, and HEADERS. GCC takes
# precompiled headers only with the flags that they were made with, and crashes over another -O: no file of a target may
# have an -O or -m of its own, unless it has SKIP_PRECOMPILE_HEADERS too.
# Files still include what they use: -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON shows what is missing.
function(lightloom_flavour name)
  cmake_parse_arguments(ARG "PIC" "" "OPTIONS;HEADERS" ${ARGN})
  add_library(lightloom_${name}_headers OBJECT ${PROJECT_SOURCE_DIR}/cmake/empty.cpp)
  set_target_properties(lightloom_${name}_headers PROPERTIES POSITION_INDEPENDENT_CODE ${ARG_PIC})
  target_compile_options(lightloom_${name}_headers PRIVATE -Wall -Wextra -Werror ${ARG_OPTIONS})
  target_precompile_headers(lightloom_${name}_headers PRIVATE
    <absl/status/statusor.h> <absl/strings/str_cat.h>
    <algorithm> <array> <atomic> <cmath> <cstdint> <filesystem> <functional> <map> <memory> <mutex> <optional> <set>
    <span> <string> <string_view> <thread> <vector> ${ARG_HEADERS})
endfunction()

# Numeric code: x86-64-v3 (AVX2), the same for every worker, so that stored bytes agree.
lightloom_flavour(core OPTIONS -march=x86-64-v3)
lightloom_flavour(core_pic PIC OPTIONS -march=x86-64-v3)
# What an engine loads, for any processor.
lightloom_flavour(runtime PIC)
# Parsing and plumbing: seconds of compilation would buy no speed. And what of it sees gRPC.
lightloom_flavour(plumbing OPTIONS $<$<CONFIG:Release>:-O1> HEADERS <nlohmann/json.hpp>)
lightloom_flavour(rpc OPTIONS $<$<CONFIG:Release>:-O1> HEADERS <grpcpp/grpcpp.h>)

# lightloom_compile(<target> <flavour>)
function(lightloom_compile target flavour)
  get_target_property(pic lightloom_${flavour}_headers POSITION_INDEPENDENT_CODE)
  get_target_property(options lightloom_${flavour}_headers COMPILE_OPTIONS)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ${pic})
  target_compile_options(${target} PRIVATE ${options})
  target_precompile_headers(${target} REUSE_FROM lightloom_${flavour}_headers)
endfunction()

# lightloom_module(<name> [FLAVOUR <flavour>] SOURCES <cpp>... [PUBLIC <targets>...] [PRIVATE <targets>...])
# A static library named lightloom_<name>, whose headers are included by their path from the root of the repository.
# FLAVOUR: that of its folder (the variable lightloom_flavour) unless named.
# PUBLIC names what its headers show, PRIVATE what only its .cpp files use; tests/link_rules checks both lists.
function(lightloom_module name)
  cmake_parse_arguments(ARG "" "FLAVOUR" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(lightloom_${name} STATIC ${ARG_SOURCES})
  target_include_directories(lightloom_${name} PUBLIC ${PROJECT_SOURCE_DIR})
  if(NOT ARG_FLAVOUR)
    set(ARG_FLAVOUR ${lightloom_flavour})
  endif()
  lightloom_compile(lightloom_${name} ${ARG_FLAVOUR})
  target_link_libraries(lightloom_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
endfunction()
