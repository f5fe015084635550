//! Exact times: decimals as written, fractions, and their sample counts.
//!
//! `0.3` is three tenths, not the nearest binary fraction. 0.3 s at 0.1 s is thus
//! exactly 3 samples. A sampling period given as an `f64` is read as the simplest
//! fraction that rounds to it: 0.1 is 1/10, 1.0/30.0 is 1/30.

use std::fmt;

/// Non-negative decimal as written, `mantissa · 10^exponent`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Decimal {
    mantissa: u64,
    exponent: i32,
}

impl Decimal {
    /// Parses digits with an optional point and exponent, `None` for too many digits.
    pub(crate) fn parse(text: &str) -> Option<Decimal> {
        let (digits, power) = match text.find(['e', 'E']) {
            Some(at) => (&text[..at], text[at + 1..].parse::<i32>().ok()?),
            None => (text, 0),
        };
        let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
        // Trailing zeros carry no value and would use up the digits of the mantissa.
        let part = part.trim_end_matches('0');
        let mut mantissa: u64 = 0;
        for digit in whole.bytes().chain(part.bytes()) {
            let digit = u64::from(digit.checked_sub(b'0').filter(|d| *d < 10)?);
            mantissa = mantissa.checked_mul(10)?.checked_add(digit)?;
        }
        if mantissa == 0 {
            return Some(Decimal {
                mantissa: 0,
                exponent: 0,
            });
        }
        let mut exponent = power.checked_sub(i32::try_from(part.len()).ok()?)?;
        // A unique representation, so that equal decimals compare equal.
        while mantissa.is_multiple_of(10) {
            mantissa /= 10;
            exponent = exponent.checked_add(1)?;
        }
        // 10³⁰ still fits an `i128`, so `ratio` cannot fail on the power.
        (exponent.unsigned_abs() <= 30).then_some(Decimal { mantissa, exponent })
    }

    pub(crate) fn ratio(self) -> Option<Ratio> {
        let power = 10i128.checked_pow(self.exponent.unsigned_abs())?;
        let mantissa = i128::from(self.mantissa);
        if self.exponent >= 0 {
            Ratio::new(mantissa.checked_mul(power)?, 1)
        } else {
            Ratio::new(mantissa, power)
        }
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = self.mantissa.to_string();
        let places = usize::try_from(-self.exponent).unwrap_or(0);
        match self.exponent {
            0 => write!(f, "{digits}"),
            // More than 19 digits would not parse back.
            1..=6 if digits.len() + self.exponent as usize <= 19 => {
                write!(f, "{digits}{}", "0".repeat(self.exponent as usize))
            }
            -12..0 if digits.len() <= places => {
                write!(f, "0.{}{digits}", "0".repeat(places - digits.len()))
            }
            -12..0 => {
                let (whole, part) = digits.split_at(digits.len() - places);
                write!(f, "{whole}.{part}")
            }
            _ => write!(f, "{digits}e{}", self.exponent),
        }
    }
}

/// Fraction in lowest terms with a positive denominator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ratio {
    over: i128,
    under: i128,
}

impl Ratio {
    /// Creates `over / under`, `None` if `under` is 0 or the terms do not fit.
    pub(crate) fn new(over: i128, under: i128) -> Option<Ratio> {
        if under == 0 {
            return None;
        }
        let common = i128::try_from(gcd(over.unsigned_abs(), under.unsigned_abs())).ok()?;
        let sign = under.signum();
        Some(Ratio {
            over: (over / common).checked_mul(sign)?,
            under: (under / common).checked_mul(sign)?,
        })
    }

    /// Returns the simplest fraction that rounds to `value`.
    ///
    /// If no small fraction does, the result is the shortest decimal of `value`.
    pub(crate) fn from_f64(value: f64) -> Option<Ratio> {
        if !value.is_finite() {
            return None;
        }
        let mut rest = value.abs();
        // Convergents p/q of the continued fraction, from simple to complex.
        let (mut p, mut q, mut p_before, mut q_before) = (1i128, 0i128, 0i128, 1i128);
        for _ in 0..40 {
            let whole = rest.floor();
            // The remainder is rounding noise by now, and its digits mean nothing.
            if whole > 1e15 {
                break;
            }
            let digit = whole as i128;
            (p, p_before) = (digit.checked_mul(p)?.checked_add(p_before)?, p);
            (q, q_before) = (digit.checked_mul(q)?.checked_add(q_before)?, q);
            // Beyond 2⁵³ the terms are not exact in f64, so the test below proves nothing.
            if (1 << 53) < p || (1 << 53) < q {
                break;
            }
            if p as f64 / q as f64 == value.abs() {
                return Ratio::new(if value < 0.0 { -p } else { p }, q);
            }
            rest = 1.0 / (rest - whole);
        }
        // `{:e}` prints the shortest decimal that rounds to the value.
        let ratio = Decimal::parse(&format!("{:e}", value.abs()))?.ratio()?;
        if value < 0.0 {
            ratio.neg()
        } else {
            Some(ratio)
        }
    }

    pub(crate) fn neg(self) -> Option<Ratio> {
        Ratio::new(self.over.checked_neg()?, self.under)
    }

    pub(crate) fn add(self, other: Ratio) -> Option<Ratio> {
        let left = self.over.checked_mul(other.under)?;
        let right = other.over.checked_mul(self.under)?;
        Ratio::new(
            left.checked_add(right)?,
            self.under.checked_mul(other.under)?,
        )
    }

    pub(crate) fn sub(self, other: Ratio) -> Option<Ratio> {
        self.add(other.neg()?)
    }

    pub(crate) fn mul(self, other: Ratio) -> Option<Ratio> {
        // Reduce across the factors first, which keeps the products small.
        let a = Ratio::new(self.over, other.under)?;
        let b = Ratio::new(other.over, self.under)?;
        Ratio::new(a.over.checked_mul(b.over)?, a.under.checked_mul(b.under)?)
    }

    pub(crate) fn div(self, other: Ratio) -> Option<Ratio> {
        self.mul(Ratio::new(other.under, other.over)?)
    }

    pub(crate) fn is_negative(self) -> bool {
        self.over < 0
    }

    pub(crate) fn is_whole(self) -> bool {
        self.under == 1
    }

    /// Returns the largest whole number that is not above the fraction.
    pub(crate) fn floor(self) -> i128 {
        self.over.div_euclid(self.under)
    }

    pub(crate) fn to_f64(self) -> f64 {
        self.over as f64 / self.under as f64
    }
}

/// A short decimal as such, any other fraction as `1/30`, which bounds may contain.
impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimal = self.to_f64().to_string();
        // Nobody counts the digits of such a bound.
        if self.to_f64().abs() >= 1e15 {
            return write!(f, "{:e}", self.to_f64());
        }
        // Longer ones are cut, and then two different times could look alike.
        if decimal.len() <= 10 || self.under > 1_000_000 {
            return write!(f, "{decimal}");
        }
        write!(f, "{}/{}", self.over, self.under)
    }
}

fn gcd(mut a: u128, mut b: u128) -> u128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    // At least 1, since callers divide by it.
    a.max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_exact_and_print_what_they_read() {
        for text in [
            "0", "0.3", "15", "1500", "0.05", "1e9", "12.5", "1e-13", "0.000001",
        ] {
            let decimal = Decimal::parse(text).unwrap();
            assert_eq!(
                Decimal::parse(&decimal.to_string()),
                Some(decimal),
                "{text}"
            );
        }
        assert_eq!(Decimal::parse("0.30").unwrap().to_string(), "0.3");
        assert_eq!(Decimal::parse("1e99"), None);
    }

    #[test]
    fn periods_are_the_simplest_fraction() {
        let cases = [
            (0.1, (1, 10)),
            (1.0 / 30.0, (1, 30)),
            (0.05, (1, 20)),
            (-2.5, (-5, 2)),
            (0.0, (0, 1)),
        ];
        for (value, (over, under)) in cases {
            assert_eq!(Ratio::from_f64(value), Ratio::new(over, under), "{value}");
        }
        assert_eq!(Ratio::from_f64(1.0 / 3.0).unwrap().to_f64(), 1.0 / 3.0);
        assert_eq!(Ratio::from_f64(f64::NAN), None);
        let long = Ratio::new(10_i128.pow(30), 1);
        assert_eq!(long.map(|it| it.to_string()), Some("1e30".to_owned()));
    }
}
