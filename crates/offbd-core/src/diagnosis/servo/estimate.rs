//! The parameters of a servo over a whole session, for trends.

/// The parameters of a servo over a session, relative to the twin's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoEstimate {
    /// Acceleration that no command explains, m/s², and its standard error.
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    /// Fraction of the command that the ball answers, and its standard error.
    pub gain: f64,
    pub gain_error: f64,
    /// Delay beyond the twin's, s, and its standard error.
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Time of motion that the estimate is based on, s.
    pub seconds: f64,
}
