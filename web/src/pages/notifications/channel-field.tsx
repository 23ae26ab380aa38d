interface Props {
  word: string;
  type?: "text" | "url" | "number" | "password";
  value: string;
  change: (value: string) => void;
}

/** A field of the form of a channel. */
export function ChannelField({ word, type = "text", value, change }: Props) {
  return (
    <label>
      {word}
      <input
        // The types of a form differ in attributes that are not used here.
        type={type as "text"}
        value={value}
        autocomplete="off"
        onInput={(e) => change(e.currentTarget.value)}
      />
    </label>
  );
}
