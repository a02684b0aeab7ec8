// ism.hpp in an engine: characters in interleaved buffers of floats, the engine's own job system, a
// budget per frame, a user who cancels, then skin weights and a morph target carried over. Built
// with -fno-exceptions -fno-rtti. Both characters are one shape in two sizes, meshed differently,
// so the best map is known: the output tells how far from it what was carried is.

#include "ism.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <thread>
#include <vector>

namespace {

constexpr int kJoints = 3;  // along each side of the sheet

struct Vertex {  // as on the GPU
  float position[3], uv[2];
  std::uint8_t joint[4];
  float weight[4];
};

struct Character {
  std::vector<Vertex> vertices;
  std::vector<std::uint16_t> indices;
  std::vector<float> blink;  // a morph target: x, y, z for each vertex

  ism::MeshView view() const {
    return {{vertices[0].position, std::ptrdiff_t(vertices.size()), sizeof(Vertex)},
            {indices.data(), std::ptrdiff_t(indices.size() / 3)}};
  }
};

/// What a joint weighs at a place of the sheet: hats between the joints of a grid.
float joint_weight(int joint, const float* uv) {
  const float x = (kJoints - 1) * uv[0] - float(joint % kJoints);
  const float y = (kJoints - 1) * uv[1] - float(joint / kJoints);
  return std::max(0.0f, 1 - std::abs(x)) * std::max(0.0f, 1 - std::abs(y));
}

float blink_height(const float* uv) { return std::sin(3 * uv[0]) * uv[1]; }

/// The strongest four of some joints, with weights that add up to 1.
void set_skin(const float (&weight)[kJoints * kJoints], Vertex& vertex) {
  float sum = 0;
  bool is_taken[kJoints * kJoints] = {};
  for (int k = 0; k < 4; ++k) {
    int best = 0;
    for (int j = 1; j < kJoints * kJoints; ++j)
      if (!is_taken[j] && (is_taken[best] || weight[j] > weight[best])) best = j;
    is_taken[best] = true;
    vertex.joint[k] = std::uint8_t(best);
    sum += vertex.weight[k] = weight[best];
  }
  for (float& w : vertex.weight) w /= sum;
}

/// A square of n×n quads with a hill, cut along one or the other diagonal.
Character hill(int n, float size, bool is_other, bool is_skinned) {
  Character c;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      Vertex v = {{0, 0, 0}, {float(j) / float(n), float(i) / float(n)}, {}, {}};
      const float x = v.uv[0] - 0.4f, y = v.uv[1] - 0.5f;
      const float height = 0.4f * std::exp(-15 * (x * x + y * y));
      for (int k = 0; k < 3; ++k) v.position[k] = size * (k < 2 ? v.uv[k] : height);
      float weight[kJoints * kJoints];
      for (int k = 0; k < kJoints * kJoints; ++k) weight[k] = joint_weight(k, v.uv);
      if (is_skinned) set_skin(weight, v);
      c.vertices.push_back(v);
      c.blink.insert(c.blink.end(), {0, is_skinned ? blink_height(v.uv) : 0, 0});
    }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int p = i * (n + 1) + j, q = p + 1, r = q + n + 1, s = p + n + 1;
      for (int id : {p, q, is_other ? s : r, is_other ? q : p, r, s})
        c.indices.push_back(std::uint16_t(id));
    }
  return c;
}

/// Stands for the engine's job system.
void run_jobs(int n, const std::function<void(int)>& job) {
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int i = next++; i < n; i = next++) job(i);
  };
  std::thread helper(work);
  work();
  helper.join();
}

/// One budgeted step per frame. The user stops it in frame 3 and goes on later.
bool solve(ism::Solver& solver, std::atomic<bool>& stop) {
  for (int frame = 1; solver.advance(0.008) || stop; ++frame) {
    if (frame == 3) stop = true;
    if (frame == 4)
      std::printf("frame 4: %s\n", ism::to_string(solver.result().status)), stop = false;
    if (frame % 10 == 0) std::printf("frame %d: %.0f%%\n", frame, 100 * solver.fraction());
  }
  return ism::is_usable(solver.result().status);
}

/// What of A its skin and its morph target are on B.
void carry(const Character& a, const ism::Transfer& transfer, Character& b) {
  constexpr std::ptrdiff_t stride = 3 * sizeof(float);
  transfer.apply(a.blink.data(), std::ptrdiff_t(a.vertices.size()), stride, 3, b.blink.data(),
                 std::ptrdiff_t(b.vertices.size()), stride);
  for (std::size_t v = 0; v < b.vertices.size(); ++v) {
    float weight[kJoints * kJoints] = {};
    for (auto k = std::size_t(transfer.offsets[v]); k < std::size_t(transfer.offsets[v + 1]); ++k) {
      const Vertex& source = a.vertices[std::size_t(transfer.sources[k])];
      for (int i = 0; i < 4; ++i)
        weight[source.joint[i]] += float(transfer.weights[k]) * source.weight[i];
    }
    if (transfer.covers(int(v))) set_skin(weight, b.vertices[v]);
  }
}

}  // namespace

int main() {
  const Character a = hill(24, 1, false, true);
  Character b = hill(19, 2.5f, true, false);
  std::atomic<bool> stop{false};
  ism::Options options;
  options.parallel_for = run_jobs;
  options.stop = &stop;
  options.boundary = ism::Boundary::kSlide;
  ism::Solver solver(a.view(), b.view(), {{0, 0}, {24, 19}, {600, 380}, {624, 399}}, options);
  if (!solve(solver, stop)) return std::puts(solver.result().message.c_str()), 1;
  const ism::SurfaceMap map(solver.result());
  carry(a,
        ism::transfer(map.meta_mesh(), ism::Side::kA, ism::Element::kVertex, ism::Element::kVertex),
        b);

  float skin = 0, blink = 0;
  for (std::size_t v = 0; v < b.vertices.size(); ++v) {
    const Vertex& vertex = b.vertices[v];
    for (int k = 0; k < 4; ++k)
      skin = std::max(skin, std::abs(vertex.weight[k] - joint_weight(vertex.joint[k], vertex.uv)));
    blink = std::max(blink, std::abs(b.blink[3 * v + 1] - blink_height(vertex.uv)));
  }
  std::printf("distortion %.4f after %zu iterations\n",
              solver.result().final_state().mean_distortion, solver.result().log.size());
  std::printf("farthest from the known transfer: skin %.4f, morph target %.4f\n", skin, blink);
  return skin < 0.02f && blink < 0.02f ? 0 : 1;
}
