// Ends of TCP connections on this machine, for tests of what is at the other end.
#pragma once

#include <arpa/inet.h>
#include <poll.h>
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

/// A way to a server on this machine that breaks once, after so many bytes of the client.
class CuttingProxy {
 public:
  CuttingProxy(const std::string& server, uint64_t cut_after)
      : port_(static_cast<uint16_t>(std::stoi(server.substr(server.rfind(':') + 1)))),
        cut_after_(cut_after),
        front_([this](int client) { serve(client); }) {}

  const std::string& address() const { return front_.address(); }
  bool was_cut() const { return cut_; }
  /// From clients to the server, on all connections.
  uint64_t bytes() const { return bytes_; }

 private:
  void serve(int client) {
    const int server = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in at = loopback(port_);
    if (::connect(server, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0) {
      pollfd ends[2] = {{client, POLLIN, 0}, {server, POLLIN, 0}};
      while (::poll(ends, 2, -1) > 0) {
        if (ends[0].revents != 0 && !(pump(client, server, true) && go_on())) break;
        if (ends[1].revents != 0 && !pump(server, client, false)) break;
      }
    }
    ::close(server);
  }
  bool pump(int from, int to, bool count) {
    char bytes[1 << 16];
    const ssize_t n = ::read(from, bytes, sizeof bytes);
    if (n <= 0) return false;
    if (count) bytes_ += static_cast<uint64_t>(n);
    for (ssize_t done = 0; done < n;) {
      const ssize_t sent = ::send(to, bytes + done, static_cast<size_t>(n - done), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      done += sent;
    }
    return true;
  }
  /// False when the connection is to be cut.
  bool go_on() {
    if (cut_ || bytes_ < cut_after_) return true;
    cut_ = true;
    return false;
  }

  const uint16_t port_;
  const uint64_t cut_after_;
  std::atomic<uint64_t> bytes_{0};
  std::atomic<bool> cut_{false};
  Answering front_;  // last: its thread uses the others
};

}  // namespace lightloom::test
