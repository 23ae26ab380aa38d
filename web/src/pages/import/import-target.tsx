import { DEFAULT_DIMENSIONS } from "../../words/dimensions";

interface Props {
  assets: string[];
  asset: string;
  setAsset: (name: string) => void;
  session: string;
  setSession: (name: string) => void;
}

/** The rig to which the recording is imported, and the name of the session. */
export function ImportTarget({ assets, asset, setAsset, session, setSession }: Props) {
  return (
    <>
      <div class="form-row">
        <label>
          Rig{" "}
          <input
            list="import-assets"
            size={24}
            value={asset}
            onInput={(e) => setAsset(e.currentTarget.value)}
            placeholder="choose or name the rig"
          />
        </label>
        <datalist id="import-assets">
          {assets.map((each) => (
            <option value={each} />
          ))}
        </datalist>
        <label>
          Session <input value={session} onInput={(e) => setSession(e.currentTarget.value)} />
        </label>
      </div>
      {!assets.includes(asset) && asset && (
        <p class="note">
          There is no rig <b>{asset}</b> yet. It will be registered with default dimensions (
          {DEFAULT_DIMENSIONS}), and servo faults cannot be confirmed until it is calibrated. Set it up first
          if its dimensions differ.
        </p>
      )}
    </>
  );
}
