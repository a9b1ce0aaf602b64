// A way to a server on this machine on which things go wrong.
#pragma once

#include <fcntl.h>
#include <poll.h>

#include <list>
#include <mutex>
#include <optional>
#include <span>

#include "tests/support/loopback.h"

namespace lightloom::test {

/// Takes any number of connections. Thread-safe.
class TcpProxy {
 public:
  enum class Go { kOn, kCut };
  /// Asked for each piece on its way, of any connection, one at a time: may change it, or cut its connection once it has
  /// arrived.
  using Meddle = std::function<Go(std::span<char> piece, bool to_server)>;

  TcpProxy(const std::string& server, Meddle meddle)
      : port_(static_cast<uint16_t>(std::stoi(server.substr(server.rfind(':') + 1)))),
        meddle_(std::move(meddle)),
        front_(std::in_place, [this](int client) { take(client); }) {}
  ~TcpProxy() {
    stop_ = true;
    front_.reset();  // no more come in
    for (std::thread& way : ways_) way.join();
  }

  const std::string& address() const { return front_->address(); }

 private:
  void take(int client) {
    const int own = ::fcntl(client, F_DUPFD_CLOEXEC, 0);  // whoever listens closes his
    ways_.emplace_back([this, own] { serve(own); });
  }
  void serve(int client) {
    const int server = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in at = loopback(port_);
    if (::connect(server, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0) {
      pollfd ends[2] = {{client, POLLIN, 0}, {server, POLLIN, 0}};
      while (!stop_) {
        if (::poll(ends, 2, 100) <= 0) continue;
        if (ends[0].revents != 0 && !pump(client, server, true)) break;
        if (ends[1].revents != 0 && !pump(server, client, false)) break;
      }
    }
    ::close(server);
    ::shutdown(client, SHUT_RDWR);
    ::close(client);
  }
  bool pump(int from, int to, bool to_server) {
    char bytes[1 << 16];
    const ssize_t n = ::read(from, bytes, sizeof bytes);
    if (n <= 0) return false;
    Go go;
    {
      const std::lock_guard lock(mutex_);
      go = meddle_({bytes, static_cast<size_t>(n)}, to_server);
    }
    for (ssize_t done = 0; done < n;) {
      const ssize_t sent = ::send(to, bytes + done, static_cast<size_t>(n - done), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      done += sent;
    }
    return go == Go::kOn;
  }

  const uint16_t port_;
  const Meddle meddle_;
  std::mutex mutex_;
  std::atomic<bool> stop_{false};
  std::list<std::thread> ways_;
  std::optional<Answering> front_;  // last: its thread uses the others
};

}  // namespace lightloom::test
