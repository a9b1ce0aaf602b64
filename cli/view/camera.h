// A camera that flies through a level: position, direction, no roll.
#pragma once

#include <optional>

#include "core/scene/scene.h"

namespace lightloom::view {

class FlyCamera {
 public:
  /// Stands where a camera of the level stands, and sees just what that sees (roll and all) until it is turned.
  void stand(const Camera& camera);
  /// Degrees: yaw 0 looks along -z and grows to the left, pitch grows upwards.
  void stand(Vec3 position, float yaw, float pitch);

  /// Radians. Stops short of straight up and down.
  void turn(float yaw, float pitch);
  /// Right, world's up, forward; in metres.
  void fly(Vec3 motion);

  Camera camera(float aspect) const;
  Vec3 position() const { return position_; }
  float yaw_degrees() const;
  float pitch_degrees() const;

 private:
  Vec3 forward() const;

  Vec3 position_;
  float yaw_ = 0, pitch_ = 0;  // radians
  float yfov_ = 0.9f;
  std::optional<Camera> exact_;
};

}  // namespace lightloom::view
