#include "cli/view/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lightloom::view {
namespace {

constexpr float kDegree = std::numbers::pi_v<float> / 180;
constexpr float kSteepest = 89.5f * kDegree;

}  // namespace

void FlyCamera::stand(const Camera& camera) {
  position_ = camera.position;
  yfov_ = camera.yfov;
  pitch_ = std::clamp(std::asin(std::clamp(camera.forward.y, -1.0f, 1.0f)), -kSteepest, kSteepest);
  yaw_ = std::atan2(-camera.forward.x, -camera.forward.z);
  exact_ = camera;
}

void FlyCamera::stand(Vec3 position, float yaw, float pitch) {
  position_ = position;
  yaw_ = yaw * kDegree;
  pitch_ = std::clamp(pitch * kDegree, -kSteepest, kSteepest);
  exact_.reset();
}

void FlyCamera::turn(float yaw, float pitch) {
  yaw_ = std::remainder(yaw_ + yaw, 2 * std::numbers::pi_v<float>);
  pitch_ = std::clamp(pitch_ + pitch, -kSteepest, kSteepest);
  exact_.reset();
}

void FlyCamera::fly(Vec3 motion) {
  const Camera now = camera(1);
  position_ += now.right * motion.x + Vec3{0, motion.y, 0} + now.forward * motion.z;
}

Vec3 FlyCamera::forward() const {
  return {-std::sin(yaw_) * std::cos(pitch_), std::sin(pitch_), -std::cos(yaw_) * std::cos(pitch_)};
}

Camera FlyCamera::camera(float aspect) const {
  Camera out;
  if (exact_) out = *exact_;
  if (!exact_) {
    out.forward = forward();
    out.right = {std::cos(yaw_), 0, -std::sin(yaw_)};
    out.up = cross(out.right, out.forward);
  }
  out.position = position_;
  out.yfov = yfov_;
  out.aspect = aspect;
  return out;
}

float FlyCamera::yaw_degrees() const { return yaw_ / kDegree; }
float FlyCamera::pitch_degrees() const { return pitch_ / kDegree; }

}  // namespace lightloom::view
