//! Finding of a check: the largest value and its bound.

/// Result of one check.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Quantity that was checked, with the inputs.
    pub tried: String,
    /// Largest value found; NaN if any value is NaN.
    pub worst: f64,
    /// Largest value allowed.
    pub bound: f64,
}

impl Finding {
    /// Finding with the largest of these values; NaN if one of them is NaN.
    pub(super) fn new(
        tried: impl Into<String>,
        bound: f64,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        let worse = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
        let worst = values
            .into_iter()
            .fold(0.0f64, |a, b| if a.is_nan() { a } else { worse(a, b) });
        Self {
            tried: tried.into(),
            worst,
            bound,
        }
    }

    /// The finding of a check that ended with an error.
    pub(super) fn failed(error: impl std::fmt::Display) -> Self {
        Self::new(error.to_string(), 0.0, [f64::NAN])
    }

    /// True if the bound holds; false if the largest value is NaN.
    pub fn holds(&self) -> bool {
        self.worst <= self.bound
    }
}
