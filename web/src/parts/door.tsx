/** Where ARCHITECTURE.md points: the login itself is beside this file. */
export { LoginGate } from "./login/login-gate";
