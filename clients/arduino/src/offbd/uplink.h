// Sends the samples of a ring in batches, oldest first, until each batch is acknowledged.
#pragma once

#include <cstddef>
#include <cstdint>

#include "ring.h"

namespace offbd {

// What became of a batch.
enum class Outcome {
  Stored,   // acknowledged: the samples are durable
  Waiting,  // sent; the acknowledgement comes by Uplink::acknowledge
  Failed,   // not sent, or refused for a reason that may pass: send it again
  Refused,  // refused for good: the same batch would be refused again
  Ended,    // the session has ended: its samples belong to another one
};

// A way to the service.
class Transport {
 public:
  virtual ~Transport() = default;
  // Sends one batch, the JSON document `body`.
  virtual Outcome send(const char *body, size_t length) = 0;
};

class Uplink {
 public:
  // Longest session name, bytes.
  static constexpr size_t NAME_BYTES = 40;
  // Longest row and frame of a batch as JSON, bytes.
  static constexpr size_t ROW_BYTES = 176;
  static constexpr size_t FRAME_BYTES = 64 + NAME_BYTES;
  // Delays between two attempts, ms: the first, which doubles, and the longest.
  static constexpr uint32_t FIRST_DELAY_MS = 200;
  static constexpr uint32_t MAX_DELAY_MS = 10000;
  // Time after which a batch that was sent, but not acknowledged, is sent again, ms.
  static constexpr uint32_t ACK_TIMEOUT_MS = 2000;

  // `body` is memory for a batch, `room` its size in bytes; a batch has as many samples as fit.
  Uplink(Ring &ring, Transport &transport, char *body, size_t room)
      : ring_(ring), transport_(transport), body_(body), room_(room) {}

  // Does what is due at `now_ms`, a clock in milliseconds that may wrap around. Call it again
  // and again, for example every 20 ms. `flush` sends less than a full batch at once; otherwise
  // it is sent when its oldest sample has waited for `HOLD_MS`.
  void poll(uint32_t now_ms, bool flush = false);

  // Notes that the service has stored all samples of `session` up to `last_seq`.
  void acknowledge(const char *session, uint32_t last_seq);

  // Notes that the line is up again: what was not acknowledged is sent at once.
  void reconnected() { state_ = State::Idle; delay_ms_ = 0; }

  // Batches that the service has refused for good; their samples are lost.
  uint32_t refused() const { return refused_; }
  // Batches that were sent more than once.
  uint32_t resent() const { return resent_; }

  // Longest time that a sample waits for a full batch, ms.
  static constexpr uint32_t HOLD_MS = 500;

 private:
  enum class State { Idle, Holding, Pausing, Waiting };

  void send(uint32_t now_ms);
  // Writes the oldest samples of one session to `body_`; sets `n_sent_`, returns the length.
  size_t write();
  // Number of samples of the next batch: those of one start that fit into the body.
  uint32_t batch_size() const;
  void name(char *to, uint32_t boot) const;
  void stored(uint32_t n);

  Ring &ring_;
  Transport &transport_;
  char *const body_;
  const size_t room_;
  State state_ = State::Idle;
  uint32_t since_ms_ = 0;   // when the state began
  uint32_t delay_ms_ = 0;   // of Pausing; also the last one
  uint32_t n_sent_ = 0;     // samples of the batch that is on its way
  uint32_t part_ = 1;       // of the session of `part_boot_`
  uint32_t part_boot_ = 0;
  bool is_repeat_ = false;  // whether the next batch begins like one that was sent before
  uint32_t refused_ = 0;
  uint32_t resent_ = 0;
};

}  // namespace offbd
