//! Colours, markers and dashes of series.
//!
//! The colours are those of Okabe & Ito (*Color Universal Design*, 2008), which
//! colour-blind readers can distinguish; each has its own marker and dash, so that a chart
//! is readable without colours.

/// The marker at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
    Cross,
    Plus,
    Ring,
    Star,
}

/// Colour, marker and dash of a series or a category.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    pub rgb: (u8, u8, u8),
    pub marker: Marker,
    /// Lengths of stroke and gap, pixels; `None`: a solid line.
    pub dash: Option<(i32, i32)>,
}

/// In the order in which they are best distinguished; yellow, faint on white, last.
const LOOKS: [Look; 8] = [
    look((0x00, 0x72, 0xB2), Marker::Circle, None),
    look((0xD5, 0x5E, 0x00), Marker::Square, Some((18, 8))),
    look((0x00, 0x9E, 0x73), Marker::Triangle, Some((6, 6))),
    look((0xCC, 0x79, 0xA7), Marker::Diamond, Some((24, 6))),
    look((0xE6, 0x9F, 0x00), Marker::Cross, Some((10, 10))),
    look((0x56, 0xB4, 0xE9), Marker::Ring, Some((14, 4))),
    look((0x00, 0x00, 0x00), Marker::Plus, Some((4, 10))),
    look((0xF0, 0xE4, 0x42), Marker::Star, None),
];

const fn look(rgb: (u8, u8, u8), marker: Marker, dash: Option<(i32, i32)>) -> Look {
    Look { rgb, marker, dash }
}

impl Look {
    /// The look of marks and reference lines.
    pub const BLACK: Self = look((0, 0, 0), Marker::Ring, None);

    /// Returns the look of the `i`-th series; looks repeat after eight.
    #[must_use]
    pub fn of(i: usize) -> Self {
        LOOKS[i % LOOKS.len()]
    }

    /// Returns the `i`-th of `n` shades of one hue, light to dark, for bins of a quantity.
    #[must_use]
    pub fn step(i: usize, n: usize) -> Self {
        let share = if n < 2 { 1.0 } else { i as f64 / (n - 1) as f64 };
        let mix = |light: f64, dark: f64| (light + share * (dark - light)).round() as u8;
        let rgb = (mix(222.0, 8.0), mix(235.0, 48.0), mix(247.0, 107.0));
        Self { rgb, ..Self::of(i) }
    }

    /// Returns the colour as in `#0072B2`.
    pub(super) fn colour(self) -> String {
        format!("#{:02X}{:02X}{:02X}", self.rgb.0, self.rgb.1, self.rgb.2)
    }

    /// Returns black or white, whichever has more contrast to this colour (luma with the
    /// coefficients of ITU-R BT.709).
    pub(super) fn ink(self) -> Self {
        let (r, g, b) = (f64::from(self.rgb.0), f64::from(self.rgb.1), f64::from(self.rgb.2));
        let light = 0.2126 * r + 0.7152 * g + 0.0722 * b > 130.0;
        Self { rgb: if light { (0, 0, 0) } else { (255, 255, 255) }, ..self }
    }
}

impl Marker {
    /// Returns its outline as an SVG path around the origin with a radius of 10, and whether
    /// it is filled.
    pub(super) fn path(self) -> (&'static str, bool) {
        const ROUND: &str = "M-10 0a10 10 0 1 0 20 0a10 10 0 1 0-20 0";
        match self {
            Self::Circle => (ROUND, true),
            Self::Ring => (ROUND, false),
            Self::Square => ("M-9-9H9V9H-9z", true),
            Self::Triangle => ("M0-10 10 8-10 8z", true),
            Self::Diamond => ("M0-12 9 0 0 12-9 0z", true),
            Self::Cross => ("M-8-8 8 8M-8 8 8-8", false),
            Self::Plus => ("M-10 0H10M0-10V10", false),
            Self::Star => ("M0-12 3-3 12 0 3 3 0 12-3 3-12 0-3-3z", true),
        }
    }
}
