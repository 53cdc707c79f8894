//! Axes: the map from values to places, and the ticks.

/// The spacing of values on an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Even spacing.
    Linear,
    /// Logarithmic spacing.
    Log,
}

/// One axis of a panel.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Its name, with the unit.
    pub label: String,
    /// Its spacing.
    pub scale: Scale,
    /// Its ends.
    pub range: [f64; 2],
    /// The value in whose place a logarithmic axis shows zero, if any.
    pub zero: Option<f64>,
}

impl Axis {
    /// A logarithmic axis over all positive `values`, its ends at 1, 2 or 5 times a power of ten.
    pub fn log(label: &str, values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extent(values.filter(|value| *value > 0.0)).unwrap_or((1.0, 10.0));
        let steps = |value: f64| {
            let decade = 10_f64.powf(value.log10().floor());
            [0.5, 1.0, 2.0, 5.0, 10.0].map(|step| step * decade)
        };
        let lower = steps(low).into_iter().rfind(|step| *step <= low).unwrap_or(low);
        let upper = steps(high).into_iter().find(|step| *step >= high).unwrap_or(high);
        let upper = if upper > lower { upper } else { lower * 10.0 };
        Self { label: label.to_owned(), scale: Scale::Log, range: [lower, upper], zero: None }
    }

    /// An even axis over all `values` with a little room at both ends.
    pub fn linear(label: &str, values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extent(values).unwrap_or((0.0, 1.0));
        let room = if high > low { 0.04 * (high - low) } else { 0.5 };
        Self { label: label.to_owned(), scale: Scale::Linear, range: [low - room, high + room], zero: None }
    }

    /// This axis with these ends.
    pub fn over(mut self, lower: f64, upper: f64) -> Self {
        self.range = [lower, upper];
        self
    }

    /// This logarithmic axis, with zero shown in the place of a small value.
    pub fn with_zero_at(mut self, value: f64) -> Self {
        self.zero = Some(value);
        self
    }

    /// The place of a value: 0 at the lower end, 1 at the upper. Values that a logarithm cannot show lie at the lower
    /// end.
    pub fn place(&self, value: f64) -> f64 {
        let [lower, upper] = self.range;
        match self.scale {
            Scale::Linear => (value - lower) / (upper - lower),
            Scale::Log if value > 0.0 => (value / lower).ln() / (upper / lower).ln(),
            Scale::Log => 0.0,
        }
    }

    /// The values to mark, and the names of those to name.
    pub fn ticks(&self) -> Vec<(f64, Option<String>)> {
        let [lower, upper] = self.range;
        let is_zero = |value: f64| self.zero.is_some_and(|zero| (value / zero - 1.0).abs() < 1e-9);
        let names = |value: f64| if is_zero(value) { "0".to_owned() } else { self.name(value) };
        let inside = |value: &f64| *value >= lower * (1.0 - 1e-9) - 1e-300 && *value <= upper * (1.0 + 1e-9);
        match self.scale {
            Scale::Log => {
                let (first, last) = (lower.log10().floor() as i32, upper.log10().ceil() as i32);
                let narrow = (upper / lower).log10() < 2.0;
                (first..=last)
                    .flat_map(|decade| (1..10).map(move |digit| (decade, digit)))
                    // Parsed, not multiplied, so that 0.3 is named 0.3.
                    .filter_map(|(decade, digit)| Some((digit, format!("{digit}e{decade}").parse::<f64>().ok()?)))
                    .filter(|(_, value)| inside(value))
                    .map(|(digit, value)| {
                        let named = digit == 1 || (narrow && matches!(digit, 2 | 5));
                        (value, named.then(|| names(value)))
                    })
                    .filter(|(value, _)| self.zero.is_none_or(|zero| *value > 9.0 * zero || is_zero(*value)))
                    .collect()
            }
            Scale::Linear => {
                let step = nice_step((upper - lower) / 5.0);
                let first = (lower / step).ceil() as i64;
                let last = (upper / step).floor() as i64;
                (first..=last)
                    .map(|tick| {
                        let value = tick as f64 * step;
                        // Away with the last digits of 3 · 0.1.
                        let value = format!("{value:.9}").parse().unwrap_or(value);
                        (value, Some(names(value)))
                    })
                    .collect()
            }
        }
    }

    /// A tick's name: a power of ten on an axis that spans many, a plain number on others.
    fn name(&self, value: f64) -> String {
        let [lower, upper] = self.range;
        if self.scale == Scale::Log && (lower < 1e-3 || upper > 1e5) {
            return format!("10{}", superscript(&format!("{:.0}", value.log10())));
        }
        format!("{value}")
    }
}

fn superscript(number: &str) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |digit: char| digit.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    number.chars().map(raised).collect()
}

fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|value| value.is_finite()).fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((value.min(low), value.max(high)))
    })
}

fn nice_step(rough: f64) -> f64 {
    let decade = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|step| step * decade).find(|step| *step >= rough).unwrap_or(10.0 * decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_axis_ends_at_round_values_and_names_them() {
        let axis = Axis::log("error (m)", [0.013, 0.3, f64::NAN, 0.0].into_iter());
        assert_eq!(axis.range, [0.01, 0.5]);
        assert!((axis.place(0.01), axis.place(0.5)) == (0.0, 1.0));
        let named: Vec<String> = axis.ticks().into_iter().filter_map(|(_, name)| name).collect();
        assert_eq!(named, ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5"]);
        assert!(Axis::log("", [3.0].into_iter()).range[1] > 3.0);
        assert_eq!(Axis::log("", [].into_iter()).range, [1.0, 10.0]);
    }

    #[test]
    fn a_log_axis_that_goes_far_names_powers_and_can_show_zero() {
        let axis = Axis::log("ε", [1e-8, 1e-6, 1e-1].into_iter()).with_zero_at(1e-8);
        let named: Vec<String> = axis.ticks().into_iter().filter_map(|(_, name)| name).collect();
        assert_eq!(named, ["0", "10⁻⁷", "10⁻⁶", "10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]);
    }

    #[test]
    fn an_even_axis_has_round_ticks() {
        let axis = Axis::linear("", [0.0, 1.0].into_iter()).over(0.0, 1.0);
        let named: Vec<String> = axis.ticks().into_iter().filter_map(|(_, name)| name).collect();
        assert_eq!(named, ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
    }
}
