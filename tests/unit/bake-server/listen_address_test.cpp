#include "bake-server/listen_address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lightloom {
namespace {

using testing::HasSubstr;

TEST(ListenAddress, AcceptsLoopback) {
  for (const char* address : {"127.0.0.1:7000", "127.8.9.1:0", "localhost:65535", "[::1]:7000"}) {
    EXPECT_TRUE(check_listen_address(address).ok()) << check_listen_address(address);
  }
}

TEST(ListenAddress, RefusesWhatOtherMachinesReach) {
  for (const char* address : {"0.0.0.0:7000", "[::]:7000", "192.168.1.2:7000", "example.org:7000", "*:7000",
                              "127.0.0.1.example.org:7000", "1270.0.0.1:7000"}) {
    EXPECT_THAT(std::string(check_listen_address(address).message()), HasSubstr("--insecure")) << address;
    EXPECT_TRUE(check_listen_address(address, /*insecure=*/true).ok()) << address;
  }
  EXPECT_FALSE(check_listen_address("0.0.0.0", /*insecure=*/true).ok());
}

TEST(ListenAddress, RefusesWhatIsNoAddress) {
  for (const char* address : {"", ":", ":7000", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1",
                              "127.0.0.1:7000x", "unix:/tmp/socket"}) {
    EXPECT_THAT(std::string(check_listen_address(address).message()), HasSubstr("HOST:PORT")) << address;
  }
}

}  // namespace
}  // namespace lightloom
