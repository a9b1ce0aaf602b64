// How bytes get from the host to the device: through one frame's part of the staging buffer, recorded into that frame.
#pragma once

#include <algorithm>
#include <deque>
#include <memory_resource>
#include <vector>

#include "runtime/asset_index.h"
#include "runtime/vulkan/buffer.h"

namespace lightloom {

/// One frame's part of the staging buffer.
class Staging {
 public:
  Staging(const Context* context, const Buffer* buffer, uint64_t offset, uint64_t bytes)
      : context_(context), buffer_(buffer), begin_(offset), at_(offset), end_(offset + bytes) {}

  uint64_t room() const { return end_ - at_; }
  /// Records a copy. REQUIRES: bytes ≤ room(); offset and bytes multiples of 4.
  void copy(VkCommandBuffer commands, VkBuffer to, uint64_t offset, const uint8_t* from, uint64_t bytes);
  uint64_t used() const { return at_ - begin_; }
  /// Before the frame is submitted.
  absl::Status flush() const { return buffer_->flush(begin_, at_ - begin_); }

 private:
  const Context* context_;
  const Buffer* buffer_;
  uint64_t begin_, at_, end_;
};

/// What a chunk brings to the device.
struct Upload {
  AssetIndex::Target target;
  VkBuffer to = VK_NULL_HANDLE;
  uint64_t offset = 0;
  std::pmr::vector<uint8_t> data;
  uint64_t done = 0;
  uint64_t zeros = 0;      ///< instead of data: bytes to be set to 0
  bool last = false;       ///< of the target's uploads
  bool cancelled = false;  ///< the chunk was unloaded meanwhile
};

/// First in, first out.
class UploadQueue {
 public:
  explicit UploadQueue(std::pmr::memory_resource* memory) : uploads_(memory) {}

  bool empty() const { return uploads_.empty(); }
  size_t size() const { return uploads_.size(); }
  void push(Upload upload) { uploads_.push_back(std::move(upload)); }
  /// `before`: how many are newer.
  Upload& newest(size_t before = 0) { return uploads_[uploads_.size() - 1 - before]; }
  /// Frees the newest upload again.
  void pop_newest() { uploads_.pop_back(); }
  void cancel(AssetIndex::Target target) { cancel_all_but_newest(target, 0); }
  void cancel_all_but_newest(AssetIndex::Target target, size_t newest);
  uint64_t pending_bytes() const;

  /// Records at most `bytes`; calls finished(target) after the last byte of a target's uploads.
  template <class Finished>
  void record(VkCommandBuffer commands, const Context& context, Staging* staging, uint64_t bytes, Finished finished);

 private:
  std::pmr::deque<Upload> uploads_;
};

/// An array that the host changes here and there: a copy of it, and what of it the device has not yet.
class ShadowTable {
 public:
  explicit ShadowTable(std::pmr::memory_resource* memory) : host_(memory), pending_(memory) {}

  /// Records of `unit` bytes reach the device as a whole. All bytes are `value`.
  absl::Status create(Context* context, uint64_t bytes, uint64_t unit, uint8_t value = 0);
  /// Sets the device's copy to what the table was created with.
  void clear(VkCommandBuffer commands, const Context& context) const;
  const Buffer& device() const { return device_; }
  void free_device() { device_ = Buffer(); }
  template <class T>
  T* as() {
    return reinterpret_cast<T*>(host_.data());
  }
  uint64_t bytes() const { return host_.size(); }
  /// Bytes [begin, end) differ from the device's.
  void touch(uint64_t begin, uint64_t end);
  uint64_t pending_bytes() const { return pending_bytes_; }
  /// Records at most `bytes` of what the device does not have.
  void record(VkCommandBuffer commands, Staging* staging, uint64_t bytes);

 private:
  Buffer device_;
  std::pmr::vector<uint8_t> host_;
  std::pmr::vector<bool>
      pending_;  // per page: the device does not have all of it. Pages, so that touch() needs no memory
  uint64_t pending_bytes_ = 0;
  uint64_t page_ = 4;
  uint8_t value_ = 0;

  uint64_t page_end(size_t page) const { return std::min(bytes(), (page + 1) * page_); }
};

template <class Finished>
void UploadQueue::record(VkCommandBuffer commands, const Context& context, Staging* staging, uint64_t bytes,
                         Finished finished) {
  while (!uploads_.empty()) {
    Upload& u = uploads_.front();
    if (!u.cancelled) {
      if (u.zeros > 0) {
        context.vk.CmdFillBuffer(commands, u.to, u.offset, u.zeros, 0);
      } else {
        const uint64_t part = std::min({u.data.size() - u.done, bytes, staging->room()}) / 4 * 4;
        if (part == 0 && !u.data.empty()) return;
        if (part > 0) staging->copy(commands, u.to, u.offset + u.done, u.data.data() + u.done, part);
        u.done += part;
        bytes -= part;
        if (u.done < u.data.size()) return;
      }
      if (u.last) finished(u.target);
    }
    uploads_.pop_front();
  }
}

}  // namespace lightloom
