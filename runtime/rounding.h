// When a difference is no more than rounding. Feedback would shift the last bits for ever.
#pragma once

namespace lightloom {

/// Relative change of a radiance that never counts, whatever epsilon.
inline constexpr float kRounding = 0x1p-19f;
/// Smoothing takes the last step when less than this share of the target is left. Nobody sees it, and rounding would
/// stop smaller ones.
inline constexpr float kArrived = 0x1p-12f;
/// The target's magnitude for that, at least, W/m².
inline constexpr float kArrivedBlack = 0x1p-20f;

}  // namespace lightloom
