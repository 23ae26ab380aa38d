#include "http.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace offbd {

Outcome HttpTransport::send(const char *body, size_t length) {
  status_ = 0;
  const bool answered =
      connection_.open(host_, port_) && post(body, length) && receive();
  connection_.close();
  if (!answered) return Outcome::Failed;
  // Only what the service itself says decides: a proxy or a portal may answer with any status.
  if (status_ == 200 && strstr(answer_, "\"accepted\":") != nullptr) {
    const char *rejected = strstr(answer_, "\"rejected\":[");
    if (rejected != nullptr && rejected[strlen("\"rejected\":[")] != ']') rejecting_++;
    return Outcome::Stored;
  }
  if (strstr(answer_, "\"urn:offbd:problem:") == nullptr) return Outcome::Failed;
  if (strstr(answer_, "\"urn:offbd:problem:session-ended\"") != nullptr) return Outcome::Ended;
  // The document itself is refused. Anything else may pass: a token or an asset that is
  // missing can be added.
  const bool is_final = status_ == 400 || status_ == 409 || status_ == 413 || status_ == 415 || status_ == 422;
  return is_final ? Outcome::Refused : Outcome::Failed;
}

bool HttpTransport::post(const char *body, size_t length) {
  char head[HEAD_BYTES];
  const int n = snprintf(head, sizeof head,
                         "POST /api/v1/assets/%s/telemetry HTTP/1.1\r\nHost: %s:%u\r\n"
                         "Content-Type: application/json\r\nContent-Length: %lu\r\n"
                         "Connection: close\r\n%s%s%s\r\n",
                         asset_, host_, static_cast<unsigned>(port_),
                         static_cast<unsigned long>(length),
                         token_ == nullptr ? "" : "Authorization: Bearer ",
                         token_ == nullptr ? "" : token_, token_ == nullptr ? "" : "\r\n");
  if (n < 0 || static_cast<size_t>(n) >= sizeof head) return false;
  return connection_.write(head, static_cast<size_t>(n)) && connection_.write(body, length);
}

bool HttpTransport::receive() {
  size_t kept = 0;
  for (;;) {
    char part[256];
    const size_t n = connection_.read(part, sizeof part);
    if (n == 0) break;
    const size_t room = ANSWER_BYTES - 1 - kept;
    const size_t more = n < room ? n : room;
    memcpy(answer_ + kept, part, more);
    kept += more;
  }
  answer_[kept] = '\0';
  const char *end = strstr(answer_, "\r\n\r\n");
  if (strncmp(answer_, "HTTP/1.", 7) != 0 || end == nullptr || kept < 12) return false;
  status_ = atoi(answer_ + 9);
  return status_ >= 200;
}

}  // namespace offbd
