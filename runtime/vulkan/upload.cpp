#include "runtime/vulkan/upload.h"

#include <algorithm>
#include <cstring>

namespace lightloom {
namespace {

constexpr uint64_t kPage = 256;  // of a table: fewer bytes are not worth a copy command of their own

}  // namespace

void Staging::copy(VkCommandBuffer commands, VkBuffer to, uint64_t offset, const uint8_t* from, uint64_t bytes) {
  std::memcpy(buffer_->mapped() + at_, from, bytes);
  const VkBufferCopy copy{at_, offset, bytes};
  context_->vk.CmdCopyBuffer(commands, buffer_->handle(), to, 1, &copy);
  at_ += bytes;
}

void UploadQueue::cancel_all_but_newest(AssetIndex::Target target, size_t newest) {
  for (size_t i = 0; i + newest < uploads_.size(); ++i) {
    Upload& u = uploads_[i];
    if (u.target.kind == target.kind && u.target.index == target.index) u.cancelled = true;
  }
}

uint64_t UploadQueue::pending_bytes() const {
  uint64_t bytes = 0;
  for (const Upload& u : uploads_) bytes += u.cancelled ? 0 : u.zeros + u.data.size() - u.done;
  return bytes;
}

absl::Status ShadowTable::create(Context* context, uint64_t bytes, uint64_t unit, uint8_t value) {
  page_ = (kPage + unit - 1) / unit * unit;
  value_ = value;
  LL_ASSIGN_OR_RETURN(device_, Buffer::create(context, bytes, BufferUse::kDevice));
  host_.assign(bytes, value);
  pending_.assign((bytes + page_ - 1) / page_, false);
  return absl::OkStatus();
}

void ShadowTable::clear(VkCommandBuffer commands, const Context& context) const {
  if (host_.empty()) return;
  const uint32_t word = value_ * 0x01010101u;
  context.vk.CmdFillBuffer(commands, device_.handle(), 0, VK_WHOLE_SIZE, word);
}

void ShadowTable::touch(uint64_t begin, uint64_t end) {
  for (size_t page = begin / page_; page * page_ < end; ++page) {
    if (pending_[page]) continue;
    pending_[page] = true;
    pending_bytes_ += page_end(page) - page * page_;
  }
}

void ShadowTable::record(VkCommandBuffer commands, Staging* staging, uint64_t bytes) {
  for (size_t first = 0; pending_bytes_ > 0 && first < pending_.size(); ++first) {
    if (!pending_[first]) continue;
    // Neighbours in one copy.
    const uint64_t begin = first * page_, most = std::min(bytes, staging->room());
    size_t end = first;
    for (; end < pending_.size() && pending_[end] && page_end(end) - begin <= most; ++end) pending_[end] = false;
    if (end == first) return;
    const uint64_t part = page_end(end - 1) - begin;
    staging->copy(commands, device_.handle(), begin, host_.data() + begin, part);
    bytes -= part;
    pending_bytes_ -= part;
    first = end - 1;
  }
}

}  // namespace lightloom
