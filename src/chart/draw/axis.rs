//! Axes: from numbers to places, and which numbers are written.

/// One axis of a panel.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it counts.
    pub label: String,
    /// How it grows.
    pub scale: Scale,
    /// How its numbers are written.
    pub unit: Unit,
    /// Lower and upper end. Default: all that is shown, with a margin.
    pub range: Option<[f64; 2]>,
}

/// How an axis grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// By factors. Only positive numbers are shown.
    Log,
    /// By steps, from 0.
    Linear,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// As they are: .1, 10, 10k.
    Plain,
    /// 1 %.
    Percent,
    /// 1e-3.
    Power,
}

/// An axis whose ends are known.
pub(super) struct Ruler {
    pub range: [f64; 2],
    scale: Scale,
    unit: Unit,
}

/// Share of the axis that is left free at either end.
const MARGIN: f64 = 0.06;

impl Axis {
    /// By factors, over all that is shown.
    pub fn log(label: &str, unit: Unit) -> Self {
        Axis { label: label.into(), scale: Scale::Log, unit, range: None }
    }

    /// From 0.
    pub fn linear(label: &str) -> Self {
        Axis { label: label.into(), scale: Scale::Linear, unit: Unit::Plain, range: None }
    }

    pub(super) fn ruler(&self, shown: impl Iterator<Item = f64>) -> Ruler {
        let range = self.range.unwrap_or_else(|| self.scale.range(shown));
        Ruler { range, scale: self.scale, unit: self.unit }
    }
}

impl Scale {
    /// True if a number has a place.
    pub fn holds(self, x: f64) -> bool {
        x.is_finite() && (self == Scale::Linear || x > 0.0)
    }

    /// Ends that hold all of these, with a margin.
    pub fn range(self, shown: impl Iterator<Item = f64>) -> [f64; 2] {
        let ends = shown
            .filter(|x| self.holds(*x))
            .fold(None, |ends: Option<[f64; 2]>, x| Some(ends.map_or([x, x], |[low, high]| [low.min(x), high.max(x)])));
        match (self, ends) {
            (Scale::Linear, ends) => [0.0, ends.map_or(1.0, |[_, high]| high.max(1e-9)) * (1.0 + MARGIN)],
            (Scale::Log, None) => [0.1, 10.0],
            (Scale::Log, Some([low, high])) => {
                // A factor of two at least.
                let middle = (low * high).sqrt();
                let (low, high) = (low.min(middle / 2f64.sqrt()), high.max(middle * 2f64.sqrt()));
                let margin = libm::pow(high / low, MARGIN);
                [low / margin, high * margin]
            }
        }
    }
}

impl Ruler {
    /// Share of the axis at which `x` lies.
    pub fn place(&self, x: f64) -> Option<f64> {
        let [low, high] = self.range;
        let inside = self.scale.holds(x) && x >= low * (1.0 - 1e-9) && x <= high * (1.0 + 1e-9);
        inside.then(|| match self.scale {
            Scale::Log => libm::log(x / low) / libm::log(high / low),
            Scale::Linear => (x - low) / (high - low),
        })
    }

    /// Numbers with a line across, and whether they are written.
    pub fn ticks(&self) -> Vec<(f64, bool)> {
        let [low, high] = self.range;
        if self.scale == Scale::Linear {
            let step = round_step(high / 5.0);
            return (0..=(high / step) as usize).map(|i| (i as f64 * step, true)).collect();
        }
        let decades = libm::log10(high / low);
        let written: &[u32] = match decades {
            d if d < 1.1 => &[1, 2, 3, 5, 7],
            d if d < 2.2 => &[1, 2, 5],
            d if d < 2.9 => &[1, 3],
            _ => &[1],
        };
        let every = (decades / 5.0).ceil().max(1.0) as i32;
        let first = libm::log10(low).floor() as i32;
        let last = libm::log10(high).ceil() as i32;
        let all = (first..=last).flat_map(|e| (1..10u32).map(move |m| (e, m)));
        let inside = |x: f64| x >= low && x <= high;
        all.map(|(e, m)| {
            (f64::from(m) * libm::pow(10.0, f64::from(e)), written.contains(&m) && (m > 1 || e.rem_euclid(every) == 0))
        })
        .filter(|(x, written)| inside(*x) && (decades < 4.0 || *written))
        .collect()
    }

    /// The number in words.
    pub fn write(&self, x: f64) -> String {
        match self.unit {
            Unit::Percent => format!("{} %", short(100.0 * x)),
            Unit::Plain => short(x),
            Unit::Power => format!("{x:.0e}"),
        }
    }
}

/// 1, 2 or 5 times a power of ten, the next above.
fn round_step(x: f64) -> f64 {
    let power = libm::pow(10.0, libm::log10(x).floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= x).unwrap_or(power)
}

/// Without needless zeros; thousands and millions by their letters.
pub(super) fn short(x: f64) -> String {
    let (x, letter) = match x.abs() {
        a if a >= 999_999.5 => (x * 1e-6, "M"),
        a if a >= 9_999.5 => (x * 1e-3, "k"),
        _ => (x, ""),
    };
    let digits = (2.0 - libm::log10(x.abs().max(1e-9)).floor()).clamp(0.0, 8.0) as usize;
    let text = format!("{x:.digits$}");
    let text = if digits > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text}{letter}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, 0.05, 1.0, 2.5, 100.0, 1024.0, 40_959.0, 1e6, 2.5e6].map(short);
        assert_eq!(shown, ["0", "0.05", "1", "2.5", "100", "1024", "41k", "1M", "2.5M"]);
    }

    #[test]
    fn an_axis_holds_what_is_shown_and_writes_some_numbers() {
        for numbers in [vec![0.3, 700.0], vec![5.0], vec![], vec![1e-9, 2.0], vec![0.21, 0.22]] {
            let ruler = Axis::log("", Unit::Plain).ruler(numbers.iter().copied());
            assert!(numbers.iter().all(|x| ruler.place(*x).is_some_and(|p| (0.0..=1.0).contains(&p))), "{numbers:?}");
            let written = ruler.ticks().iter().filter(|t| t.1).count();
            assert!((1..=9).contains(&written), "{numbers:?}: {written}");
        }
        assert!(Axis::log("", Unit::Plain).ruler([1.0].into_iter()).place(-1.0).is_none());
    }
}
