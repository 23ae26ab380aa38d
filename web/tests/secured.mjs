// A service that requires a token.
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { offbd, serve } from "./support.mjs";

/** Starts the service in the directory `work`. Returns it, the token of an administrator, and what sends JSON. */
export async function secured(work) {
  const data = join(work, "data");
  const admin = offbd("token", "create", "--name", "ann", "--role", "admin", "--data", data).trim();
  writeFileSync(join(work, "offbd.toml"), "auth = 'required'\n");
  const service = await serve(data, 0, "--config", join(work, "offbd.toml"));
  const asks = (method, path, token, body) =>
    fetch(`${service.url}/api/v1${path}`, {
      method,
      headers: { authorization: `Bearer ${token}`, "content-type": "application/json" },
      body: body && JSON.stringify(body),
    });
  return { service, admin, asks };
}
