//! Arithmetic expressions of parameters: `${…}`.

use core::f64::consts::PI;

/// Greatest depth of nested brackets.
const MAX_DEPTH: usize = 100;

/// Value of an expression without its `${` and `}`.
///
/// `value` returns the value of a parameter.
///
/// # Errors
///
/// Returns a message for invalid syntax, an unknown parameter or a value that
/// is not finite.
pub(crate) fn evaluate(
    text: &str,
    value: &dyn Fn(&str) -> Result<f64, String>,
) -> Result<f64, String> {
    let mut cursor = ExpressionCursor {
        rest: text,
        value,
        depth: 0,
    };
    let result = cursor.sum()?;
    // Blanks behind the expression are no error.
    cursor.blank();
    match cursor.rest.is_empty() {
        true if result.is_finite() => Ok(result),
        true => Err(format!("`{text}` is {result}")),
        false => Err(format!("`{}` is not understood", cursor.rest)),
    }
}

struct ExpressionCursor<'a> {
    rest: &'a str,
    value: &'a dyn Fn(&str) -> Result<f64, String>,
    depth: usize,
}

impl<'a> ExpressionCursor<'a> {
    fn blank(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take(&mut self, c: char) -> bool {
        self.blank();
        let rest = self.rest.strip_prefix(c);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn sum(&mut self) -> Result<f64, String> {
        let mut sum = self.product()?;
        // Left to right, since `1 - 2 - 3` is −4.
        loop {
            if self.take('+') {
                sum += self.product()?;
            } else if self.take('-') {
                sum -= self.product()?;
            } else {
                return Ok(sum);
            }
        }
    }

    fn product(&mut self) -> Result<f64, String> {
        let mut product = self.factor()?;
        loop {
            if self.take('*') {
                product *= self.factor()?;
            } else if self.take('/') {
                product /= self.factor()?;
            } else {
                return Ok(product);
            }
        }
    }

    fn factor(&mut self) -> Result<f64, String> {
        // Guards the stack: a file can nest brackets or signs without end.
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err("its brackets nest too deeply".to_owned());
        }
        let value = self.atom();
        self.depth -= 1;
        value
    }

    fn atom(&mut self) -> Result<f64, String> {
        if self.take('-') {
            return Ok(-self.factor()?);
        }
        if self.take('+') {
            return self.factor();
        }
        if self.take('(') {
            let value = self.sum()?;
            return if self.take(')') {
                Ok(value)
            } else {
                Err("a bracket is not closed".to_owned())
            };
        }
        if self.take('$') {
            let name = self.word(|c| c.is_alphanumeric() || c == '_');
            return (self.value)(name);
        }
        // A sign belongs to a number only after its exponent, so `1-2` remains
        // a difference.
        let mut before = '0';
        let number = self.word(|c| {
            let sign = matches!(c, '+' | '-') && matches!(before, 'e' | 'E');
            let exponent = matches!(c, 'e' | 'E') && before.is_ascii_digit();
            let part = c.is_ascii_digit() || c == '.' || sign || exponent;
            before = c;
            part
        });
        if !number.is_empty() {
            return number
                .parse()
                .map_err(|_| format!("`{number}` is no number"));
        }
        let name = self.word(|c| c.is_alphanumeric() || c == '_');
        self.call(name)
    }

    fn word(&mut self, mut part: impl FnMut(char) -> bool) -> &'a str {
        self.blank();
        let end = self.rest.find(|c| !part(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        word
    }

    fn call(&mut self, name: &str) -> Result<f64, String> {
        if name == "pi" {
            return Ok(PI);
        }
        if !self.take('(') {
            return Err(if name.is_empty() {
                format!("`{}` is not understood", self.rest)
            } else {
                format!("`{name}` is not understood")
            });
        }
        let first = self.sum()?;
        let mut all = vec![first];
        while self.take(',') {
            all.push(self.sum()?);
        }
        if !self.take(')') {
            return Err(format!("the bracket of `{name}` is not closed"));
        }
        match (name, &all[..]) {
            ("pow", [a, b]) => Ok(libm::pow(*a, *b)),
            ("min", [a, b]) => Ok(a.min(*b)),
            ("max", [a, b]) => Ok(a.max(*b)),
            ("sqrt", [a]) => Ok(a.sqrt()),
            ("sin", [a]) => Ok(libm::sin(*a)),
            ("cos", [a]) => Ok(libm::cos(*a)),
            ("tan", [a]) => Ok(libm::tan(*a)),
            ("asin", [a]) => Ok(libm::asin(*a)),
            ("acos", [a]) => Ok(libm::acos(*a)),
            ("atan", [a]) => Ok(libm::atan(*a)),
            ("abs", [a]) => Ok(a.abs()),
            // `signum` of 0 is 1, but OpenSCENARIO's `sign` of 0 is 0.
            ("sign", [a]) => Ok(if *a == 0.0 { 0.0 } else { a.signum() }),
            _ => Err(format!(
                "`{name}` of {} values is not understood",
                all.len()
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_have_the_values_of_arithmetic() {
        let value = |name: &str| match name {
            "v" => Ok(50.0),
            _ => Err(format!("no parameter `{name}`")),
        };
        let of = |text: &str| evaluate(text, &value);
        let cases = [
            ("$v/3.6", 50.0 / 3.6),
            ("1 - 2 - 3", -4.0),
            ("2 * (3 + 4) / 7", 2.0),
            ("-pow(2, 3) + 1.5e1", 7.0),
            ("0.6/2-0.36", 0.3 - 0.36),
            ("2*-3", -6.0),
            ("sqrt($v * $v)", 50.0),
            ("cos(pi)*sign(-4)", 1.0),
            ("min(abs(-3), 2)", 2.0),
            ("1e3", 1000.0),
        ];
        for (text, expected) in cases {
            let found = of(text).expect(text);
            assert!((found - expected).abs() < 1e-12, "{text}: {found}");
        }
        // The last text starts like an exponent without digits.
        for text in ["", "1 +", "$w", "foo(1)", "(1", "1/0", "pow(1)", "1 2", "e"] {
            assert!(of(text).is_err(), "{text}");
        }
    }
}
