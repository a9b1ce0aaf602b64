// Ends of TCP connections on this machine, for tests of what is at the other end.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/check.h"

namespace lightloom::test {

inline sockaddr_in loopback(uint16_t port) {
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  at.sin_port = htons(port);
  return at;
}

/// Connections are taken by the system and stay unanswered.
class Listener {
 public:
  Listener() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in at = loopback(0);
    socklen_t size = sizeof at;
    LL_CHECK(::bind(socket_, reinterpret_cast<sockaddr*>(&at), size) == 0 && ::listen(socket_, 16) == 0);
    LL_CHECK(::getsockname(socket_, reinterpret_cast<sockaddr*>(&at), &size) == 0);
    address_ = "127.0.0.1:" + std::to_string(ntohs(at.sin_port));
  }
  ~Listener() { ::close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  const std::string& address() const { return address_; }
  int socket() const { return socket_; }

 private:
  int socket_;
  std::string address_;
};

/// Answers each connection in turn by `serve(socket)`, in a thread of its own, and closes it.
class Answering {
 public:
  explicit Answering(std::function<void(int)> serve) : serve_(std::move(serve)), thread_([this] { run(); }) {}
  ~Answering() {
    ::shutdown(listener_.socket(), SHUT_RDWR);  // ends accept()
    thread_.join();
  }
  Answering(const Answering&) = delete;
  Answering& operator=(const Answering&) = delete;
  const std::string& address() const { return listener_.address(); }

 private:
  void run() {
    for (int one; (one = ::accept4(listener_.socket(), nullptr, nullptr, SOCK_CLOEXEC)) >= 0; ::close(one)) serve_(one);
  }

  Listener listener_;
  std::function<void(int)> serve_;
  std::thread thread_;
};

}  // namespace lightloom::test
