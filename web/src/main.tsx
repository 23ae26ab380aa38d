import { render } from "preact";
import { App } from "./app/app";
import { Route } from "./app/route";
import { preload } from "./parts/lazy";
import { LoginGate } from "./parts/login/login-gate";
import { segmentsOf } from "./router/navigation";
import "./style.css";

// The code of the view is loaded while the service is asked who the caller is.
preload(Route({ segments: segmentsOf(location.pathname), isDemo: false }));

render(
  <LoginGate>
    <App />
  </LoginGate>,
  document.getElementById("app")!,
);
