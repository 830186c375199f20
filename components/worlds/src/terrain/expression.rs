//! Heights as equations: arithmetic of `x` and `y`.

/// An expression of `x` and `y`.
#[derive(Clone, Debug)]
pub(super) enum Expression {
    Number(f64),
    X,
    Y,
    Negated(Box<Self>),
    Two(Box<Self>, Operation, Box<Self>),
    One(fn(f64) -> f64, Box<Self>),
    OfTwo(fn(f64, f64) -> f64, Box<Self>, Box<Self>),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Operation {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
}

const FUNCTIONS: &str = "sin, cos, tan, exp, log, sqrt, abs, floor, min, max";

/// Maximum nesting depth.
const DEEPEST: usize = 64;

impl Expression {
    /// Parses an expression.
    ///
    /// # Errors
    /// The column, from 1, with the text found and the expectation.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut reader = Reader { text, at: 0, depth: 0 };
        let expression = reader.sum()?;
        match reader.peek() {
            None => Ok(expression),
            Some(_) => Err(reader.expected("an operator or the end")),
        }
    }

    pub(super) fn value(&self, x: f64, y: f64) -> f64 {
        match self {
            Self::Number(number) => *number,
            Self::X => x,
            Self::Y => y,
            Self::Negated(of) => -of.value(x, y),
            Self::One(function, of) => function(of.value(x, y)),
            Self::OfTwo(function, first, second) => function(first.value(x, y), second.value(x, y)),
            Self::Two(left, operation, right) => {
                let (left, right) = (left.value(x, y), right.value(x, y));
                match operation {
                    Operation::Add => left + right,
                    Operation::Subtract => left - right,
                    Operation::Multiply => left * right,
                    Operation::Divide => left / right,
                    Operation::Power => left.powf(right),
                }
            }
        }
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl Reader<'_> {
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += if found { wanted.len_utf8() } else { 0 };
        found
    }

    fn expected(&mut self, what: &str) -> String {
        let found = self.peek().map_or("the end".to_owned(), |found| format!("`{found}`"));
        let column = self.text[..self.at].chars().count() + 1;
        format!("column {column}: found {found}, expected {what}")
    }

    fn sum(&mut self) -> Result<Expression, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("more than {DEEPEST} nested brackets"));
        }
        let mut left = self.product()?;
        loop {
            let operation = match self.peek() {
                Some('+') => Operation::Add,
                Some('-') => Operation::Subtract,
                _ => break,
            };
            self.at += 1;
            left = Expression::Two(Box::new(left), operation, Box::new(self.product()?));
        }
        self.depth -= 1;
        Ok(left)
    }

    fn product(&mut self) -> Result<Expression, String> {
        let mut left = self.signed()?;
        loop {
            let operation = match self.peek() {
                Some('*') => Operation::Multiply,
                Some('/') => Operation::Divide,
                _ => return Ok(left),
            };
            self.at += 1;
            left = Expression::Two(Box::new(left), operation, Box::new(self.signed()?));
        }
    }

    fn signed(&mut self) -> Result<Expression, String> {
        let mut negative = false;
        while self.peek() == Some('-') {
            self.at += 1;
            negative = !negative;
        }
        let power = self.power()?;
        Ok(if negative { Expression::Negated(Box::new(power)) } else { power })
    }

    fn power(&mut self) -> Result<Expression, String> {
        let base = self.atom()?;
        if !self.take('^') {
            return Ok(base);
        }
        let negative = self.take('-');
        let exponent = self.atom()?;
        let exponent = if negative { Expression::Negated(Box::new(exponent)) } else { exponent };
        Ok(Expression::Two(Box::new(base), Operation::Power, Box::new(exponent)))
    }

    fn atom(&mut self) -> Result<Expression, String> {
        match self.peek() {
            Some('(') => {
                self.at += 1;
                let inner = self.sum()?;
                if self.take(')') { Ok(inner) } else { Err(self.expected("`)`")) }
            }
            Some(first) if first.is_ascii_digit() || first == '.' => self.number(),
            Some(first) if first.is_ascii_alphabetic() => self.name(),
            _ => Err(self.expected("a number, `x`, `y`, a function or a bracket")),
        }
    }

    fn number(&mut self) -> Result<Expression, String> {
        let rest = &self.text.as_bytes()[self.at..];
        let sign_of_exponent =
            |index: usize| matches!(rest[index], b'+' | b'-') && matches!(rest[index - 1], b'e' | b'E');
        let part = |index: usize| {
            rest[index].is_ascii_digit()
                || matches!(rest[index], b'.' | b'e' | b'E')
                || index > 0 && sign_of_exponent(index)
        };
        let length = (0..rest.len()).take_while(|index| part(*index)).count();
        let number = self.text[self.at..self.at + length].parse();
        let number = number.map_err(|_| self.expected("a number"))?;
        self.at += length;
        Ok(Expression::Number(number))
    }

    fn name(&mut self) -> Result<Expression, String> {
        let rest = &self.text[self.at..];
        let length = rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
        let name = &rest[..length];
        let one: fn(f64) -> f64 = match name {
            "x" | "y" | "pi" => {
                self.at += length;
                return Ok(match name {
                    "x" => Expression::X,
                    "y" => Expression::Y,
                    _ => Expression::Number(std::f64::consts::PI),
                });
            }
            "min" | "max" => {
                let function: fn(f64, f64) -> f64 = if name == "min" { f64::min } else { f64::max };
                self.at += length;
                let first = self.argument('(')?;
                let second = self.argument(',')?;
                return self.close(Expression::OfTwo(function, first, second));
            }
            "sin" => f64::sin,
            "cos" => f64::cos,
            "tan" => f64::tan,
            "exp" => f64::exp,
            "log" => f64::ln,
            "sqrt" => f64::sqrt,
            "abs" => f64::abs,
            "floor" => f64::floor,
            _ => {
                let column = self.text[..self.at].chars().count() + 1;
                return Err(format!(
                    "column {column}: found `{name}`, expected x, y, pi or one of {FUNCTIONS}"
                ));
            }
        };
        self.at += length;
        let argument = self.argument('(')?;
        self.close(Expression::One(one, argument))
    }

    fn argument(&mut self, before: char) -> Result<Box<Expression>, String> {
        if self.take(before) { Ok(Box::new(self.sum()?)) } else { Err(self.expected(&format!("`{before}`"))) }
    }

    fn close(&mut self, of: Expression) -> Result<Expression, String> {
        if self.take(')') { Ok(of) } else { Err(self.expected("`)`")) }
    }
}

#[cfg(test)]
mod tests {
    use super::Expression;

    #[test]
    fn arithmetic_has_the_order_of_textbooks() {
        for (text, expected) in [
            ("1 + 2 * 3 - 4 / 2", 5.0),
            ("-2^2", -4.0),
            ("2^-1 * x", 1.5),
            ("(x - y) - 1", -3.0),
            ("8 / 4 / 2", 1.0),
            ("max(x, y) + min(1, sqrt(16))", 6.0),
            ("0.5e1*sin(pi / 2) + abs(-x)", 8.0),
            ("1e-1 + 1E+1", 10.1),
            ("--x", 3.0),
        ] {
            let value = Expression::parse(text).unwrap().value(3.0, 5.0);
            assert!((value - expected).abs() < 1e-12, "{text} = {value}");
        }
    }

    #[test]
    fn syntax_error_is_reported_with_its_column() {
        for (text, expected) in [
            ("1 +", "column 4: found the end, expected a number"),
            ("0.1 * sni(x)", "column 7: found `sni`, expected x, y, pi or one of sin"),
            ("sin x", "column 5: found `x`, expected `(`"),
            ("(x + 1", "column 7: found the end, expected `)`"),
            ("x y", "column 3: found `y`, expected an operator"),
            ("min(x)", "column 6: found `)`, expected `,`"),
            ("1.2.3", "column 1: found `1`, expected a number"),
            ("é", "column 1: found `é`"),
            (&"(".repeat(100), "more than 64"),
        ] {
            let error = Expression::parse(text).unwrap_err();
            assert!(error.starts_with(expected), "{text}: {error}");
        }
    }
}
