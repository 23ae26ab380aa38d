import { useState } from "preact/hooks";
import type { Asset } from "../../api/types";
import { CodeBlock } from "../../parts/code-block";
import { useCaller } from "../../parts/login/caller";
import { DeviceToken } from "./device-token";
import { SamplesStatus } from "./samples-status";
import { snippets, unitsOf } from "./snippets";
import { useWatchedRig } from "./use-watched-rig";

/** Placeholder in the snippets until a token has been created. */
const TOKEN_PLACEHOLDER = "offbd_TOKEN";

const LOCAL = /localhost|127\.0\.0\.1/;
const localNote = ({ hostname, port }: Location) =>
  ` A device on the network needs the name or address of this computer instead of ${hostname}, ` +
  `and the service must listen on it (--listen 0.0.0.0:${port || 80}). Then it requires a token of everyone: create ` +
  "the first one with “offbd token create”.";

/** Snippets for sending samples, and whether samples arrive. */
export function Connect({ asset, next }: { asset: Asset; next: () => void }) {
  const { name } = asset;
  const [token, setToken] = useState(TOKEN_PLACEHOLDER);
  const isTokenNeeded = useCaller()?.authentication === "required";
  const all = snippets(name, location.origin, isTokenNeeded ? token : undefined, unitsOf(asset));
  const [language, setLanguage] = useState("Python");
  const { state, isSending } = useWatchedRig(name);
  const hasSent = (state?.samples ?? 0) > 0;
  return (
    <section class="card">
      <p>
        Send samples in batches, several times per second. The service answers after they are stored;
        duplicates count once.
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
        <DeviceToken asset={name} created={setToken} />
        {LOCAL.test(location.hostname) && localNote(location)}
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
