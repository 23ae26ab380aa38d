import { render } from "preact";
import { App } from "./app/app";
import { LoginGate } from "./parts/login/login-gate";
import "./style.css";

render(
  <LoginGate>
    <App />
  </LoginGate>,
  document.getElementById("app")!,
);
