#include "core/base/hash.h"

#include <openssl/evp.h>

#include "core/base/check.h"

namespace lightloom {

std::string Digest::hex() const {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  out.reserve(64);
  for (const uint8_t b : bytes) {
    out.push_back(kDigits[b >> 4]);
    out.push_back(kDigits[b & 15]);
  }
  return out;
}

uint64_t Digest::low64() const {
  uint64_t v = 0;
  for (int i = 7; i >= 0; --i) v = v << 8 | bytes[static_cast<size_t>(i)];
  return v;
}

Hasher::Hasher() : context_(EVP_MD_CTX_new()) {
  LL_CHECK(context_ && EVP_DigestInit_ex(static_cast<EVP_MD_CTX*>(context_), EVP_sha256(), nullptr) == 1);
}

Hasher::~Hasher() { EVP_MD_CTX_free(static_cast<EVP_MD_CTX*>(context_)); }

Hasher& Hasher::bytes(const void* data, size_t size) {
  LL_CHECK(EVP_DigestUpdate(static_cast<EVP_MD_CTX*>(context_), data, size) == 1);
  return *this;
}

Hasher& Hasher::string(std::string_view s) {
  value(static_cast<uint64_t>(s.size()));
  return bytes(s.data(), s.size());
}

Digest Hasher::finish() {
  Digest d;
  LL_CHECK(EVP_DigestFinal_ex(static_cast<EVP_MD_CTX*>(context_), d.bytes.data(), nullptr) == 1);
  return d;
}

Digest sha256(std::span<const uint8_t> data) { return Hasher().bytes(data.data(), data.size()).finish(); }
Digest sha256(std::string_view data) { return Hasher().bytes(data.data(), data.size()).finish(); }

}  // namespace lightloom
