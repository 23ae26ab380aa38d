#include "uplink.h"

#include <cmath>
#include <cstdio>
#include <cstring>

namespace offbd {

namespace {

// Nine digits give the same 32-bit float again.
size_t write_number(char *to, size_t room, const char *name, float value) {
  if (!std::isfinite(value)) return snprintf(to, room, ",\"%s\":null", name);
  return snprintf(to, room, ",\"%s\":%.9g", name, static_cast<double>(value));
}

size_t write_row(char *to, size_t room, const NumberedSample &row) {
  const Sample &sample = row.sample;
  size_t used = snprintf(to, room, "{\"seq\":%lu,\"t_s\":%.6f",
                         static_cast<unsigned long>(row.seq), static_cast<double>(sample.t_us) / 1e6);
  used += write_number(to + used, room - used, "cmd_qx_rad", sample.qx_rad);
  used += write_number(to + used, room - used, "cmd_qy_rad", sample.qy_rad);
  used += write_number(to + used, room - used, "x_m", sample.x_m);
  used += write_number(to + used, room - used, "y_m", sample.y_m);
  to[used++] = '}';
  return used;
}

}  // namespace

void Uplink::poll(uint32_t now_ms, bool flush) {
  const uint32_t waited_ms = now_ms - since_ms_;
  switch (state_) {
    case State::Waiting:
      if (waited_ms >= ACK_TIMEOUT_MS) send(now_ms);
      return;
    case State::Pausing:
      if (waited_ms >= delay_ms_) send(now_ms);
      return;
    case State::Idle:
      if (ring_.size() == 0) return;
      state_ = State::Holding;
      since_ms_ = now_ms;
      break;
    case State::Holding:
      break;
  }
  const uint32_t n = batch_size();
  const bool is_full = n < ring_.size() || (n + 1) * ROW_BYTES + FRAME_BYTES > room_;
  if (flush || is_full || now_ms - since_ms_ >= HOLD_MS) send(now_ms);
}

void Uplink::send(uint32_t now_ms) {
  if (ring_.size() == 0) {
    state_ = State::Idle;
    return;
  }
  const size_t length = write();
  if (is_repeat_) resent_++;
  // Before sending: the acknowledgement may come while the transport is at work.
  state_ = State::Waiting;
  since_ms_ = now_ms;
  is_repeat_ = true;
  switch (transport_.send(body_, length)) {
    case Outcome::Waiting:
      return;
    case Outcome::Stored:
      stored(n_sent_);
      return;
    case Outcome::Refused:
      refused_++;
      stored(n_sent_);
      return;
    case Outcome::Ended: {
      const uint32_t boot = ring_.at(0).boot;
      part_ = boot == part_boot_ ? part_ + 1 : 2;
      part_boot_ = boot;
    }
    // Tried again after a pause, in case that session has ended as well.
    [[fallthrough]];
    case Outcome::Failed:
      state_ = State::Pausing;
      delay_ms_ = delay_ms_ == 0 ? FIRST_DELAY_MS : delay_ms_ * 2;
      if (delay_ms_ > MAX_DELAY_MS) delay_ms_ = MAX_DELAY_MS;
      return;
  }
}

void Uplink::stored(uint32_t n) {
  ring_.take(n);
  state_ = State::Idle;
  delay_ms_ = 0;
  is_repeat_ = false;
}

void Uplink::acknowledge(const char *session, uint32_t last_seq) {
  // An acknowledgement of an earlier batch that was sent twice, or of another start, says
  // nothing about the oldest samples.
  if (ring_.size() == 0) return;
  char own[NAME_BYTES];
  const uint32_t boot = ring_.at(0).boot;
  name(own, boot);
  if (strcmp(own, session) != 0) return;
  uint32_t n = 0;
  while (n < n_sent_ && n < ring_.size() && ring_.at(n).boot == boot && ring_.at(n).seq <= last_seq) n++;
  if (n > 0) stored(n);
}

uint32_t Uplink::batch_size() const {
  const uint32_t boot = ring_.at(0).boot;
  const uint32_t waiting = ring_.size();
  uint32_t n = 0;
  while (n < waiting && ring_.at(n).boot == boot && (n + 1) * ROW_BYTES + FRAME_BYTES <= room_) n++;
  return n;
}

size_t Uplink::write() {
  char session[NAME_BYTES];
  name(session, ring_.at(0).boot);
  n_sent_ = batch_size();
  size_t used = snprintf(body_, room_, "{\"session\":\"%s\",\"samples\":[", session);
  for (uint32_t i = 0; i < n_sent_; i++) {
    if (i > 0) body_[used++] = ',';
    used += write_row(body_ + used, room_ - used, ring_.at(i));
  }
  body_[used++] = ']';
  body_[used++] = '}';
  return used;
}

// The clock and the numbers restart with the board, and so does the session. A session that
// somebody has ended goes on in another one, with the number of its part.
void Uplink::name(char *to, uint32_t boot) const {
  const auto id = static_cast<unsigned long>(ring_.id());
  const auto start = static_cast<unsigned long>(boot);
  if (part_ == 1 || boot != part_boot_) {
    snprintf(to, NAME_BYTES, "board-%08lx-%lu", id, start);
  } else {
    snprintf(to, NAME_BYTES, "board-%08lx-%lu-%lu", id, start, static_cast<unsigned long>(part_));
  }
}

}  // namespace offbd
