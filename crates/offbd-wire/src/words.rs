//! The closed sets of words in the API: each is an enum here, an `enum` in `openapi.yaml`
//! and a union type in the dashboard's TypeScript.
//!
//! The core stores its enums under the names of their variants, so those that the API shows
//! are mirrored here. The words of a fault come from the core's list; a variant of another
//! enum that is added there and not here does not compile.

use utoipa::ToSchema;

use offbd_core::diagnosis::Profile;
use offbd_core::diagnosis::trend::Parameter;
use offbd_core::engine::{Misfit, Order, Rejection};
use offbd_core::fault_words;
use offbd_core::plant::Rung;
use offbd_core::vocabulary::{Axis, FaultCode, FaultKind, FaultStatus};

/// Defines an enum whose variants are serialised as the given words.
macro_rules! words {
    ($(#[$doc:meta])* $name:ident as $schema:ident {
        $($(#[$vdoc:meta])* $variant:ident = $word:tt),+ $(,)?
    }) => {
        offbd_core::words! {
            $(#[$doc])*
            #[derive(ToSchema)]
            #[schema(as = $schema)]
            $name { $($(#[$vdoc])* #[serde(rename = $word)] $variant = $word),+ }
        }
    };
}

/// Defines [`words!`] for an enum of the core, with conversions in both directions.
macro_rules! mirrored {
    ($(#[$doc:meta])* $name:ident as $schema:ident of $core:ident {
        $($(#[$vdoc:meta])* $variant:ident = $word:tt),+ $(,)?
    }) => {
        words! { $(#[$doc])* $name as $schema { $($(#[$vdoc])* $variant = $word),+ } }

        impl From<$core> for $name {
            fn from(word: $core) -> Self {
                match word { $($core::$variant => Self::$variant),+ }
            }
        }

        impl From<$name> for $core {
            fn from(word: $name) -> Self {
                match word { $($name::$variant => Self::$variant),+ }
            }
        }
    };
}

words! {
    /// Why a row of telemetry is not judged.
    UnjudgedWord as UnjudgedReason {
        /// A value is not a finite number.
        NotFinite = "not_finite",
        /// A value is beyond all reason.
        Absurd = "absurd",
        /// It came too late; it is recorded.
        Late = "late",
        /// The clock jumped and no further row confirmed it; it is recorded.
        Jump = "jump",
        /// Another row with its number, or time, has other values.
        Conflict = "conflict",
        /// It is too old to tell whether it is recorded.
        TooOld = "too_old",
        /// It is not a sample.
        Form = "form",
        /// Its session has ended.
        SessionEnded = "session_ended",
    }
}

impl From<Rejection> for UnjudgedWord {
    fn from(why: Rejection) -> Self {
        match why {
            Rejection::NotFinite { .. } => Self::NotFinite,
            Rejection::Absurd { .. } => Self::Absurd,
            Rejection::Late { .. } => Self::Late,
            Rejection::Jump { .. } => Self::Jump,
            Rejection::Conflict { .. } => Self::Conflict,
            Rejection::TooOld => Self::TooOld,
            Rejection::Malformed => Self::Form,
        }
    }
}

fault_words! { codes, mirrored!
    /// Fault code: the part of the rig that has the fault.
    CodeWord as FaultCode of FaultCode
}

fault_words! { kinds, mirrored!
    /// Kind of a fault: the failure mode.
    KindWord as FaultKind of FaultKind
}

fault_words! { statuses, mirrored!
    /// Status of a fault code, a summary of its ISO 14229 status byte.
    StatusWord as FaultStatus of FaultStatus
}

mirrored! {
    /// A direction of ball motion.
    AxisWord as Axis of Axis { X = "x", Y = "y" }
}

mirrored! {
    /// Named set of settings of the diagnosis: `default` for real rigs, `textbook` for the
    /// rule of the book.
    ProfileWord as Profile of Profile { Default = "default", Textbook = "textbook" }
}

mirrored! {
    /// A parameter of a servo that is tracked over sessions: gain, offset in m/s², delay in
    /// s.
    ParameterWord as ServoParameter of Parameter {
        Gain = "gain", Offset = "offset", Delay = "delay",
    }
}

mirrored! {
    /// A plant model of the twin, in the order of computing cost.
    ModelWord as PlantModel of Rung {
        Planar = "planar", Rolling = "rolling", Sliding = "sliding",
    }
}

mirrored! {
    /// Order of a drive cycle's motions along the two axes: simultaneously, y a quarter of a
    /// period after x, or first x and then y.
    CycleOrderWord as DriveCycleOrder of Order {
        AtOnce = "at_once", Staggered = "staggered", InTurn = "in_turn",
    }
}

words! {
    /// The plate angle that a servo turns: `qy` moves the ball along x, `qx` along y.
    CommandWord as PlateAngle { Qx = "qx", Qy = "qy" }
}

impl From<Axis> for CommandWord {
    fn from(axis: Axis) -> Self {
        match axis {
            Axis::X => Self::Qy,
            Axis::Y => Self::Qx,
        }
    }
}

words! {
    /// A contradiction between data and asset file.
    MisfitWord as Misfit {
        NoReadings = "no_readings", NoCommands = "no_commands", NoAxis = "no_axis",
        Short = "short", Rate = "rate", Positions = "positions", Commands = "commands",
        CommandsHeld = "commands_held", OneAxis = "one_axis", Swapped = "swapped",
        WrongSign = "wrong_sign", Scale = "scale", NoRoom = "no_room", Level = "level",
    }
}

impl From<&Misfit> for MisfitWord {
    fn from(misfit: &Misfit) -> Self {
        match misfit {
            Misfit::NoReadings => Self::NoReadings,
            Misfit::NoCommands => Self::NoCommands,
            Misfit::NoAxis => Self::NoAxis,
            Misfit::Short { .. } => Self::Short,
            Misfit::Rate { .. } | Misfit::OtherRate { .. } => Self::Rate,
            Misfit::Positions { .. } => Self::Positions,
            Misfit::Commands { .. } => Self::Commands,
            Misfit::CommandsHeld => Self::CommandsHeld,
            Misfit::OneAxis { .. } => Self::OneAxis,
            Misfit::Swapped { .. } => Self::Swapped,
            Misfit::WrongSign { .. } => Self::WrongSign,
            Misfit::Scale { .. } => Self::Scale,
            Misfit::NoRoom { .. } => Self::NoRoom,
            Misfit::Level { .. } => Self::Level,
        }
    }
}

words! {
    /// The kind of a line of a verdict.
    LineWord as LineType { Fault = "fault", Summary = "summary" }
}

words! {
    /// State of a session: an ended one accepts no more samples.
    SessionState as SessionState { Open = "open", Ended = "ended" }
}

words! {
    /// State of a background job.
    JobState as JobState {
        Queued = "queued", Running = "running", Done = "done", Failed = "failed",
    }
}

words! {
    /// What a background job does.
    JobKind as JobKind {
        Replay = "replay", Calibration = "calibration",
    }
}

words! {
    /// Why a background job waits.
    JobWaitReason as JobWaitReason {
        /// Other jobs run or come before it.
        Jobs = "jobs",
        /// Samples are queued; what a rig learns by itself begins when fewer are.
        Samples = "samples",
    }
}

words! {
    /// How a transition differs between two verdicts.
    ChangeWord as TransitionChange {
        /// In both verdicts, with equal time, kind and onset.
        Same = "same",
        /// In both verdicts at the same time, with a different kind or onset.
        Altered = "altered",
        /// In both verdicts, at different times.
        Moved = "moved",
        /// Only in the recorded verdict.
        OnlyRecorded = "only_recorded",
        /// Only in the replayed verdict.
        OnlyReplayed = "only_replayed",
    }
}

words! {
    /// Selects faults by status.
    StatusFilter as FaultStatusFilter {
        /// Pending or confirmed.
        Active = "active",
        Pending = "pending", Confirmed = "confirmed", Healed = "healed", Cleared = "cleared",
        All = "all",
    }
}

words! {
    /// Order of a list of faults.
    FaultSort as FaultSort {
        /// The latest change first.
        Newest = "-changed_at",
        /// The earliest change first.
        Oldest = "changed_at",
        /// By name of the asset.
        Asset = "asset",
    }
}

words! {
    /// How the values of several sessions become one.
    SeriesAggregate as SeriesAggregate {
        Mean = "mean", Min = "min", Max = "max",
        /// The value of the latest session.
        Last = "last",
    }
}

words! {
    /// Order of a list of sessions.
    SessionSort as SessionSort {
        /// The session that was opened last first.
        Newest = "-opened_at",
        /// The session that was opened first first.
        Oldest = "opened_at",
    }
}

words! {
    /// Selects sessions by verdict; an open session has none.
    VerdictFilter as VerdictFilter {
        /// At least one fault was confirmed.
        Fault = "fault",
        /// No fault was confirmed.
        NoFault = "no_fault",
    }
}

words! {
    /// An entry of the history of a fault code: the status it changed to, or the action of a
    /// person.
    HistoryWord as HistoryEvent {
        Pending = "pending", Confirmed = "confirmed", Healed = "healed", Cleared = "cleared",
        Acknowledge = "acknowledge", Clear = "clear",
    }
}

words! {
    /// Role of a token, in the order of its rights.
    Role as Role {
        /// The device of one asset.
        Device = "device",
        /// May read everything and change nothing.
        Viewer = "viewer",
        /// May also operate the assets and handle their faults.
        Operator = "operator",
        /// May do everything.
        Admin = "admin",
    }
}

words! {
    /// Whether the service requires a token.
    AuthenticationWord as Authentication { Required = "required", Off = "off" }
}

/// Defines the codes of alarms: the fault codes, and those that no monitor finds.
macro_rules! alarm_codes {
    ({ $($(#[$vdoc:meta])* $variant:ident = $word:tt),+ $(,)? }) => {
        words! {
            /// What an alarm is about: a fault code, or that no data of the rig arrive.
            AlarmCodeWord as AlarmCode {
                $($(#[$vdoc])* $variant = $word,)+
                /// No data arrive although a session is open. Found by the service, not by a
                /// monitor.
                CommunicationLost = "communication_lost",
            }
        }

        impl From<CodeWord> for AlarmCodeWord {
            fn from(code: CodeWord) -> Self {
                match code { $(CodeWord::$variant => Self::$variant),+ }
            }
        }

        impl AlarmCodeWord {
            /// The fault code, if a monitor finds this.
            #[must_use]
            pub const fn fault_code(self) -> Option<CodeWord> {
                match self {
                    $(Self::$variant => Some(CodeWord::$variant),)+
                    Self::CommunicationLost => None,
                }
            }
        }
    };
}

fault_words! { codes, alarm_codes! }

words! {
    /// A change that a notification tells of.
    AlarmChangeWord as AlarmChange {
        /// The test fails; the fault is not confirmed yet.
        Pending = "pending",
        /// The test fails, and the fault is confirmed.
        Confirmed = "confirmed",
        /// The test passes again; the fault stays on record.
        Passed = "passed",
        /// Enough good sessions followed.
        Healed = "healed",
        /// A person has erased the record.
        Cleared = "cleared",
    }
}

words! {
    /// Selects alarms.
    AlarmStateFilter as AlarmStateFilter {
        /// The test fails, and the fault is confirmed; or data of the rig have stopped.
        Failing = "failing",
        /// The test fails; the fault is not confirmed yet.
        Suspected = "suspected",
        /// On record as pending or confirmed; the test does not fail now.
        OnRecord = "on_record",
        /// Failing, suspected or on record.
        Active = "active",
        /// Healed ones and those of lost communication that is back, too.
        All = "all",
    }
}

words! {
    /// How much of the evidence of an occurrence is kept.
    EvidenceWord as EvidenceState {
        /// The recording of the session, and the values at the first failure.
        Complete = "complete",
        /// The values at the first failure.
        Partial = "partial",
        /// Nothing.
        None = "none",
    }
}

words! {
    /// State of a delivery.
    DeliveryState as DeliveryState {
        /// Waits for its turn or its next attempt.
        Pending = "pending",
        Delivered = "delivered",
        /// All attempts have failed for too long.
        GivenUp = "given_up",
    }
}

words! {
    /// How a channel sends.
    ChannelKind as ChannelKind { Webhook = "webhook", Email = "email" }
}

words! {
    /// What a webhook posts.
    #[derive(Default)]
    WebhookFormat as WebhookFormat {
        /// A CloudEvent in structured JSON, for programs.
        #[default]
        CloudEvents = "cloudevents",
        /// An incoming webhook of Slack, which Mattermost and others take too: `{"text": …}`.
        Slack = "slack",
        /// An adaptive card, for a workflow of Microsoft Teams.
        Teams = "teams",
        /// Plain text.
        Text = "text",
    }
}

words! {
    /// Encryption of the connection to a mail server.
    MailSecurity as MailSecurity {
        /// From the start (port 465).
        Tls = "tls",
        /// After the greeting (port 587); without it, nothing is sent.
        StartTls = "starttls",
        /// None.
        None = "none",
    }
}

#[cfg(test)]
mod tests {
    use std::fmt;

    use serde::Serialize;

    use super::*;

    /// Checks that the words of a core enum equal those of its mirror.
    fn assert_equal_words<C: Copy + Into<W>, W: Copy + fmt::Display + Serialize>(
        core: &[C],
        words: &[W],
        name: impl Fn(C) -> &'static str,
    ) {
        assert_eq!(core.len(), words.len());
        for &word in core {
            let mirrored: W = word.into();
            assert_eq!(mirrored.to_string(), name(word));
            assert_eq!(serde_json::to_value(mirrored).unwrap(), name(word));
        }
    }

    #[test]
    fn the_words_equal_those_of_the_core() {
        assert_equal_words(&Axis::ALL, AxisWord::ALL, Axis::as_str);
        assert_equal_words(&Axis::ALL, CommandWord::ALL, Axis::command);
        assert_equal_words(&Profile::ALL, ProfileWord::ALL, Profile::as_str);
        assert_equal_words(&Parameter::ALL, ParameterWord::ALL, Parameter::as_str);
        assert_equal_words(
            &[Rung::Planar, Rung::Rolling, Rung::Sliding],
            ModelWord::ALL,
            Rung::name,
        );
    }
}
