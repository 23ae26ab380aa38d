import { useState } from "preact/hooks";
import { CodeBlock } from "../../parts/code-block";
import { useCaller } from "../../parts/login/caller";
import { DeviceToken } from "./device-token";
import { SamplesStatus } from "./samples-status";
import { snippets } from "./snippets";
import { useWatchedRig } from "./use-watched-rig";

/** What stands in a snippet until there is a token for the device. */
const NO_TOKEN_YET = "offbd_TOKEN";

const LOCAL = /localhost|127\.0\.0\.1/;
const LOCAL_NOTE =
  " A device needs this computer's name or address instead of 127.0.0.1, " +
  "and the service must listen there (--listen 0.0.0.0:8087).";

/** How the device sends, and whether it does. */
export function Connect({ name, next }: { name: string; next: () => void }) {
  const [token, setToken] = useState(NO_TOKEN_YET);
  const isTokenNeeded = useCaller()?.authentication === "required";
  const all = snippets(name, location.origin, isTokenNeeded ? token : undefined);
  const [language, setLanguage] = useState("Python");
  const { state, isSending } = useWatchedRig(name);
  const hasSent = (state?.samples ?? 0) > 0;
  return (
    <section class="card">
      <p>
        Send samples as they come, ten times a second or so. The service answers once they are stored; what is
        sent twice counts once.
      </p>
      <div class="chips" role="group" aria-label="Language">
        {all.map((each) => (
          <button
            type="button"
            aria-pressed={each.language === language}
            onClick={() => setLanguage(each.language)}
          >
            {each.language}
          </button>
        ))}
      </div>
      <CodeBlock label={`${language} snippet`}>
        {all.find((each) => each.language === language)!.text}
      </CodeBlock>
      <p class="quiet small-text">
        <DeviceToken asset={name} made={setToken} />
        {LOCAL.test(location.hostname) && LOCAL_NOTE}
      </p>
      <SamplesStatus state={hasSent ? state : undefined} isSending={isSending} />
      <div class="form-end">
        <button type="button" class="primary" disabled={!hasSent} onClick={next}>
          Check it
        </button>
      </div>
    </section>
  );
}
