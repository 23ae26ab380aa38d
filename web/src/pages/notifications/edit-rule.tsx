import { useState } from "preact/hooks";
import type { Channel, Rule } from "../../api/alarms";
import { Dialog } from "../../parts/dialog";
import { RuleForm } from "./rule-form";

interface Props {
  rule: Rule;
  channels: Channel[];
  refetch: () => Promise<unknown>;
}

/** Opens the form of a rule. */
export function EditRule({ rule, channels, refetch }: Props) {
  const [isOpen, setOpen] = useState(false);
  const saved = () => {
    setOpen(false);
    void refetch();
  };
  return (
    <>
      <button type="button" class="small" aria-label={`Edit ${rule.name}`} onClick={() => setOpen(true)}>
        Edit
      </button>
      {isOpen && (
        <Dialog title={`Edit the rule ${rule.name}`} close={() => setOpen(false)}>
          <RuleForm rule={rule} channels={channels} saved={saved} />
        </Dialog>
      )}
    </>
  );
}
