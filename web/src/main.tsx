import { render } from "preact";
import { App } from "./app/app";
import { LoginGate } from "./parts/door";
import "./style.css";

render(
  <LoginGate>
    <App />
  </LoginGate>,
  document.getElementById("app")!,
);
