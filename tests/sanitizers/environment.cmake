# What tests need when they run under a sanitizer (LIGHTLOOM_SANITIZE).
if(LIGHTLOOM_SANITIZE MATCHES "thread")
  # gRPC, Mesa and Embree are not instrumented: without this their own synchronisation is invisible and reported.
  list(APPEND lightloom_test_environment
    "TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1:ignore_noninstrumented_modules=1:suppressions=${CMAKE_CURRENT_LIST_DIR}/tsan.supp")
endif()
if(LIGHTLOOM_SANITIZE MATCHES "address")
  list(APPEND lightloom_test_environment
    "ASAN_OPTIONS=strict_string_checks=1:detect_stack_use_after_return=1"
    "UBSAN_OPTIONS=print_stacktrace=1"
    "LSAN_OPTIONS=suppressions=${CMAKE_CURRENT_LIST_DIR}/lsan.supp:print_suppressions=0")
endif()

# Leaks inside a driver that has been unloaded have no module name left to suppress them by: keep it mapped.
set(lightloom_keep_driver_source ${CMAKE_CURRENT_LIST_DIR}/keep_vulkan_driver.cpp)
function(lightloom_keep_vulkan_driver target)
  if(LIGHTLOOM_SANITIZE MATCHES "address")
    target_sources(${target} PRIVATE ${lightloom_keep_driver_source})
    target_link_libraries(${target} PRIVATE ${CMAKE_DL_LIBS})
  endif()
endfunction()
