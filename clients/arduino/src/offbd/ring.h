// Samples between the control loop, which must never wait, and the uplink, which may wait for
// the network for minutes.
//
// One thread pushes, one thread takes; neither waits for the other. The memory belongs to the
// caller: in RTC memory of an ESP32, which survives a restart without a power cut, samples that
// were not acknowledged before the restart are sent after it.
#pragma once

#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace offbd {

// One sample; a float that is NaN is a missing value: no ball was seen, or no such axis.
struct Sample {
  int64_t t_us;      // time since the board started, microseconds
  float qx_rad;      // commanded plate angles
  float qy_rad;
  float x_m;         // measured position of the ball
  float y_m;
};

// A sample with its place: `seq` counts from 1 within each start of the board.
struct NumberedSample {
  Sample sample;
  uint32_t seq;
  uint32_t boot;
};

// The memory of a ring of up to `CAPACITY` samples, 32 bytes each. Do not initialise it where it
// shall survive a restart.
template <size_t CAPACITY>
struct RingMemory {
  uint64_t magic;
  uint32_t capacity;
  uint32_t id;    // drawn when the memory was formatted
  uint32_t boot;  // number of the present start since then, from 1
  uint32_t seq;   // of the last sample pushed since the start
  std::atomic<uint32_t> pushed;  // samples pushed since the memory was formatted, modulo 2^32
  std::atomic<uint32_t> taken;
  NumberedSample samples[CAPACITY];
};

class Ring {
 public:
  // Uses `memory`. Samples that an earlier start left in it are kept; memory without a ring is
  // formatted with the random number `id`.
  template <size_t CAPACITY>
  Ring(RingMemory<CAPACITY> &memory, uint32_t id)
      : capacity_(CAPACITY), id_(memory.id), boot_(memory.boot), seq_(memory.seq),
        pushed_(memory.pushed), taken_(memory.taken), samples_(memory.samples) {
    // 2^32 must be a multiple of the capacity, because the counters wrap around.
    static_assert(CAPACITY > 0 && (CAPACITY & (CAPACITY - 1)) == 0, "a power of two");
    if (memory.magic != MAGIC || memory.capacity != CAPACITY || size() > CAPACITY) {
      memory.capacity = CAPACITY;
      id_ = id;
      boot_ = 0;
      pushed_.store(0);
      taken_.store(0);
      memory.magic = MAGIC;
    }
    boot_++;
    seq_ = 0;
  }

  // Adds a sample. If the ring is full the sample is lost and counted, because the oldest one
  // may be on its way; returns whether it was kept.
  bool push(const Sample &sample) {
    seq_++;
    const uint32_t at = pushed_.load(std::memory_order_relaxed);
    if (at - taken_.load(std::memory_order_acquire) >= capacity_) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    samples_[at % capacity_] = NumberedSample{plausible(sample), seq_, boot_};
    pushed_.store(at + 1, std::memory_order_release);
    return true;
  }

  // Number of samples that wait.
  uint32_t size() const {
    return pushed_.load(std::memory_order_acquire) - taken_.load(std::memory_order_relaxed);
  }

  // The `i`-th oldest sample; `i` must be below size().
  const NumberedSample &at(uint32_t i) const {
    return samples_[(taken_.load(std::memory_order_relaxed) + i) % capacity_];
  }

  // Forgets the `n` oldest samples; `n` must not be above size().
  void take(uint32_t n) {
    taken_.store(taken_.load(std::memory_order_relaxed) + n, std::memory_order_release);
  }

  // Samples lost because the ring was full, since the start.
  uint32_t dropped() const { return dropped_.load(std::memory_order_relaxed); }
  uint32_t id() const { return id_; }
  uint32_t boot() const { return boot_; }

 private:
  // Numbers that the service would refuse are missing values, so that it takes every sample: a
  // reading beyond 50 m, a command beyond a turn.
  static Sample plausible(const Sample &sample) {
    const auto within = [](float value, float limit) {
      return std::fabs(value) <= limit ? value : NAN;
    };
    return Sample{sample.t_us, within(sample.qx_rad, 6.28F), within(sample.qy_rad, 6.28F),
                  within(sample.x_m, 50.0F), within(sample.y_m, 50.0F)};
  }

  static constexpr uint64_t MAGIC = 0x6f66666264310001;  // and a version of the layout

  const uint32_t capacity_;
  uint32_t &id_;
  uint32_t &boot_;
  uint32_t &seq_;
  std::atomic<uint32_t> &pushed_;
  std::atomic<uint32_t> &taken_;
  NumberedSample *const samples_;
  std::atomic<uint32_t> dropped_{0};
};

}  // namespace offbd
