// Streams a ball-on-plate rig to offbd from an ESP32, over HTTP.
//
// The control loop never waits for the network: it pushes samples into a ring, and a task on the
// other core sends them until the service has stored them. The ring is in RTC memory, so that
// samples which were not sent yet survive a restart (not a power cut).
//
// Arduino IDE: board "ESP32 Dev Module"; this library and the board's own. Fill in the five
// settings and the three functions of your rig.

#include <Offbd.h>
#include <WiFi.h>

// ---- settings ---------------------------------------------------------------
static const char *WIFI_NAME = "your-network";
static const char *WIFI_PASSWORD = "your-password";
static const char *HOST = "192.168.1.10";  // of the service, port 8087
static const char *ASSET = "my-rig";
static const int64_t PERIOD_US = 10000;  // 100 Hz

// ---- your rig ---------------------------------------------------------------
// Reads the ball's position in metres; returns false if no ball is seen.
static bool readBall(float *x_m, float *y_m) {
  *x_m = 0.0f;
  *y_m = 0.0f;
  return true;
}

// Your controller: plate angles in radians. +qy moves the ball toward +x, +qx
// toward -y.
static void control(bool seen, float x_m, float y_m, float *qx_rad, float *qy_rad) {
  *qx_rad = seen ? 0.5f * y_m : 0.0f;
  *qy_rad = seen ? -0.5f * x_m : 0.0f;
}

// Moves the servos to these angles, radians.
static void drive(float qx_rad, float qy_rad) {
  (void)qx_rad;
  (void)qy_rad;
}

// ---- telemetry --------------------------------------------------------------
// 4 KiB of the 8 KiB of RTC memory: 1.3 s at 100 Hz. Without RTC_NOINIT_ATTR it can be larger,
// 4096 samples for 40 s, but does not survive a restart.
RTC_NOINIT_ATTR static offbd::RingMemory<128> memory;
static offbd::Ring *ring;
static char body[offbd::Uplink::FRAME_BYTES + 50 * offbd::Uplink::ROW_BYTES];

static void uplinkTask(void *) {
  static WiFiClient client;
  static offbd::BoardConnection connection(client);
  static offbd::HttpTransport transport(connection, HOST, 8087, ASSET);
  static offbd::Uplink uplink(*ring, transport, body, sizeof body);
  for (;;) {
    if (WiFi.status() == WL_CONNECTED) uplink.poll(millis());
    vTaskDelay(pdMS_TO_TICKS(20));
  }
}

// ---- the device -------------------------------------------------------------
void setup() {
  Serial.begin(115200);
  WiFi.mode(WIFI_STA);
  WiFi.setAutoReconnect(true);
  WiFi.begin(WIFI_NAME, WIFI_PASSWORD);
  static offbd::Ring kept(memory, esp_random());
  ring = &kept;
  xTaskCreatePinnedToCore(uplinkTask, "uplink", 8192, NULL, 1, NULL, 0);
}

void loop() {
  static int64_t due_us = esp_timer_get_time();
  while (esp_timer_get_time() < due_us) {
  }
  offbd::Sample sample = {esp_timer_get_time(), 0.0f, 0.0f, NAN, NAN};
  float x_m = 0.0f, y_m = 0.0f;
  const bool seen = readBall(&x_m, &y_m);
  control(seen, x_m, y_m, &sample.qx_rad, &sample.qy_rad);
  drive(sample.qx_rad, sample.qy_rad);
  if (seen) {
    sample.x_m = x_m;
    sample.y_m = y_m;
  }
  ring->push(sample);
  due_us += PERIOD_US;
}
