// Irradiance per surface element as images: the lightmap users sample, and its value at a hit.
#pragma once

#include <array>
#include <span>

#include "core/receivers/receiver_search.h"
#include "core/relight/surface_inputs.h"
#include "core/scene/image.h"

namespace lightloom {

/// Gives texels without light of their own (A is 0) that of their neighbours, up to four texels away; A stays. REQUIRES: R, G,
/// B, A.
void dilate(Image* image);

/// R, G, B: E of the front side, or the back, W/m²; A: 1 at receivers; area: m² in the texel. Texels without a receiver
/// next to one (gutters, texels inside solids) are filled from their neighbours, A = 0, so that bilinear filtering stays
/// clean.
Image lightmap_image(const SurfaceElements& elements, std::span<const Vec3> irradiance, bool back = false);

/// Where that is: x, y.
std::array<int, 2> pixel_of(const SurfaceElements& elements, const Receiver& receiver);

/// Bilinear over the receivers of the hit's object and side around it; the nearest one if there is none.
/// `search` is of the elements' receivers.
Vec3 sample_irradiance(const SurfaceElements& elements, const ReceiverSearch& search, std::span<const Vec3> irradiance,
                       const Hit& hit);

}  // namespace lightloom
