/** Code snippets that send samples to the service. */
import type { Asset } from "../../api/types";

export interface Snippet {
  language: string;
  text: string;
}

/** The units that a device sends. */
export interface Units {
  angle: string;
  length: string;
}

const SI: Units = { angle: "rad", length: "m" };

/** Returns the units that the description of a rig says its device sends. */
export function unitsOf({ axes }: Pick<Asset, "axes">): Units {
  const metres = axes?.position_unit_m ?? 1;
  const length = { 1: "m", 0.001: "mm", 0.01: "cm" }[metres] ?? `units of ${metres} m`;
  const radians = axes?.command_unit_rad ?? 1;
  const isDegree = Math.abs(radians - Math.PI / 180) < 1e-9;
  const angle = radians === 1 ? "rad" : isDegree ? "degrees" : `units of ${radians} rad`;
  return { angle, length };
}

/**
 * Returns the snippets for `asset`, with `token` if the service requires one. The keys of a sample end with _rad
 * and _m in any case; the service converts from the units of the rig's description.
 */
export function snippets(asset: string, origin: string, token?: string, units = SI): Snippet[] {
  const urlFrom = (origin: string) => `${origin}/api/v1/assets/${encodeURIComponent(asset)}/telemetry`;
  // A microcontroller is a separate machine and cannot reach the service at localhost.
  const remote = origin.replace(/\/\/(localhost|127\.0\.0\.1)/, "//SERVER");
  return [
    { language: "curl", text: curl(urlFrom(origin), units, token) },
    { language: "Python", text: python(urlFrom(origin), units, token) },
    { language: "Arduino / ESP32", text: arduino(urlFrom(remote), units, token) },
  ];
}

/** Explains the names of the keys, which are those of SI units. */
const remark = ({ angle, length }: Units) =>
  angle === SI.angle && length === SI.length ? "" : " (whatever the keys are called: the service converts)";

function curl(url: string, units: Units, token?: string): string {
  const header = token ? `-H 'authorization: Bearer ${token}' ` : "";
  return `# One sample: time on the device's clock in s, commanded angles in ${units.angle},
# ball position in ${units.length}${remark(units)}.
curl ${header}--json '{"samples":[{"seq":1,"t_s":0.00,"cmd_qx_rad":0.0,"cmd_qy_rad":0.02,"x_m":0.010,"y_m":-0.004}]}' \\
  ${url}

# A whole recording with the header t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m
curl ${header}-H 'content-type: text/csv' --data-binary @recording.csv ${url}
`;
}

function python(url: string, units: Units, token?: string): string {
  const header = token ? `, "authorization": "Bearer ${token}"` : "";
  return `import json, time, urllib.request

URL = "${url}"

def read_rig():
    """Replace this: commanded plate angles in ${units.angle}, ball position in ${units.length} (None if not seen)."""
    return 0.0, 0.0, 0.0, 0.0          # qx, qy, x, y

def send(samples):
    request = urllib.request.Request(
        URL, json.dumps({"samples": samples}).encode(), {"content-type": "application/json"${header}})
    with urllib.request.urlopen(request, timeout=5) as answer:
        return json.load(answer)       # {"accepted": 20, "rejected": [], ...}: stored

seq, batch, start = 0, [], time.monotonic()
while True:
    qx, qy, x, y = read_rig()
    seq += 1
    batch.append({"seq": seq, "t_s": time.monotonic() - start,
                  "cmd_qx_rad": qx, "cmd_qy_rad": qy, "x_m": x, "y_m": y})
    if len(batch) >= 20:               # 5 times per second at 100 samples per second
        try:
            send(batch)
            batch = []
        except OSError as error:       # keep the batch and retry: duplicates count once
            print("not sent:", error)
            batch = batch[-6000:]
    time.sleep(0.01)
`;
}

function arduino(url: string, units: Units, token?: string): string {
  const header = token ? `\n  http.addHeader("authorization", "Bearer ${token}");` : "";
  return `#include <WiFi.h>
#include <HTTPClient.h>

const char* URL = "${url}";
String batch;
uint32_t seq = 0, n = 0;

void sample(float qx, float qy, float x, float y) {   // ${units.angle} and ${units.length}; every 10 ms
  char row[120];
  snprintf(row, sizeof row,
    "%s{\\"seq\\":%u,\\"t_s\\":%.4f,\\"cmd_qx_rad\\":%.5f,\\"cmd_qy_rad\\":%.5f,\\"x_m\\":%.5f,\\"y_m\\":%.5f}",
    n ? "," : "", ++seq, millis() / 1000.0, qx, qy, x, y);
  batch += row;
  if (++n < 20) return;                              // a batch of 20 samples, 5 times per second
  HTTPClient http;
  http.begin(URL);
  http.addHeader("content-type", "application/json");${header}
  int status = http.POST("{\\"samples\\":[" + batch + "]}");
  http.end();
  if (status == 200 || n > 200) { batch = ""; n = 0; }  // otherwise retried with the next batch
}

void setup() {
  WiFi.begin("NETWORK", "PASSWORD");
  while (WiFi.status() != WL_CONNECTED) delay(100);
}

void loop() {
  sample(/* qx */ 0, /* qy */ 0, /* x */ 0, /* y */ 0);   // your values
  delay(10);
}
`;
}
