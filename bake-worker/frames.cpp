#include "bake-worker/frames.h"

#include <sys/socket.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <cstdint>
#include <cstring>

namespace lightloom {
namespace {

constexpr uint32_t kMost = uint32_t{1} << 30;
static_assert(std::endian::native == std::endian::little);

}  // namespace

Frames::~Frames() { ::close(descriptor_); }

absl::Status Frames::write(std::string_view message) {
  const auto size = static_cast<uint32_t>(message.size());
  const std::lock_guard lock(writing_);
  LL_RETURN_IF_ERROR(send_all(reinterpret_cast<const char*>(&size), sizeof size));
  return send_all(message.data(), message.size());
}

absl::StatusOr<std::optional<std::string>> Frames::read() {
  uint32_t size = 0;
  if (!receive_all(reinterpret_cast<char*>(&size), sizeof size)) return std::nullopt;
  if (size > kMost) return absl::DataLossError("what arrived on the executor's socket is no message of this program");
  std::string message(size, '\0');
  if (!receive_all(message.data(), size)) return std::nullopt;
  return message;
}

absl::Status Frames::send_all(const char* data, size_t size) {
  while (size > 0) {
    const ssize_t n = ::send(descriptor_, data, size, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return absl::UnavailableError(std::string("the executor's socket is closed: ") + std::strerror(errno));
    data += n;
    size -= static_cast<size_t>(n);
  }
  return absl::OkStatus();
}

bool Frames::receive_all(char* data, size_t size) {
  while (size > 0) {
    const ssize_t n = ::recv(descriptor_, data, size, 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    data += n;
    size -= static_cast<size_t>(n);
  }
  return true;
}

}  // namespace lightloom
