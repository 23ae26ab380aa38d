// What the sketches in examples/ use of an ESP32 and its libraries, so that a host can check them.
// Only declarations: nothing here runs.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#define RTC_NOINIT_ATTR

uint32_t millis();
void delay(uint32_t ms);
int64_t esp_timer_get_time();
uint32_t esp_random();
uint32_t pdMS_TO_TICKS(uint32_t ms);
void vTaskDelay(uint32_t ticks);
int xTaskCreatePinnedToCore(void (*task)(void *), const char *name, uint32_t stack, void *of,
                            unsigned priority, void **handle, int core);

struct SerialPort {
  void begin(unsigned long baud);
};
extern SerialPort Serial;
