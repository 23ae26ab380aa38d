interface Props {
  assets: string[];
  asset: string;
  setAsset: (name: string) => void;
  session: string;
  setSession: (name: string) => void;
}

/** The rig to which the recording is imported, and what the session is called. */
export function ImportTarget({ assets, asset, setAsset, session, setSession }: Props) {
  return (
    <>
      <div class="form-row">
        <label>
          Rig{" "}
          <input
            list="import-assets"
            value={asset}
            onInput={(e) => setAsset(e.currentTarget.value)}
            placeholder="name of the rig"
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
          There is no rig <b>{asset}</b> yet; it is registered as the book chapter's rig. Its set-up can be
          changed later.
        </p>
      )}
    </>
  );
}
