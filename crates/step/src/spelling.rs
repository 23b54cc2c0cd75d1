//! How values are spelled.

/// A list of entities.
pub fn references(ids: &[u64]) -> String {
    // Room for seven digits each.
    let mut list = String::with_capacity(9 * ids.len() + 2);
    list.push('(');
    for (k, id) in ids.iter().enumerate() {
        list.push_str(if k > 0 { ",#" } else { "#" });
        push_number(&mut list, *id);
    }
    list.push(')');
    list
}

/// A number as the standard wants it: with a decimal point, exponent as E. Reads back to the same bits.
pub fn real(x: f64) -> String {
    let mut text = String::new();
    push_real(&mut text, x);
    text
}

/// [`real`] at the end of `line`. A file of some hundred thousand points is hardly more than this.
pub(crate) fn push_real(line: &mut String, x: f64) {
    let start = line.len();
    line.push_str(zmij::Buffer::new().format(x));
    // Exponents are rare.
    if let Some(place) = line[start..].find('e') {
        let has_point = line[start..start + place].contains('.');
        line.replace_range(start + place..start + place + 1, if has_point { "E" } else { ".E" });
    }
}

/// A whole number at the end of `line`.
pub(crate) fn push_number(line: &mut String, n: u64) {
    line.push_str(itoa::Buffer::new().format(n));
}

/// A string for a STEP file: quotes doubled, anything but printable ASCII as its code point.
pub fn text(s: &str) -> String {
    let mut out = String::with_capacity(s.len());
    for c in s.chars() {
        match c {
            '\'' => out.push_str("''"),
            '\\' => out.push_str("\\\\"),
            ' '..='~' => out.push(c),
            _ if (c as u32) < 0x1_0000 => out.push_str(&format!("\\X2\\{:04X}\\X0\\", c as u32)),
            _ => out.push_str(&format!("\\X4\\{:08X}\\X0\\", c as u32)),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_point_and_read_back() {
        for x in [0.0, 1.0, -2.5, 1e-7, 1.25e-300, 1e300, 1.0 / 3.0, 123456789.125] {
            let written = real(x);
            assert!(written.contains('.'), "{written}");
            assert_eq!(written.parse::<f64>().unwrap().to_bits(), x.to_bits());
        }
        assert_eq!(real(1e-7), "1.E-7");
    }

    #[test]
    fn numbers_of_all_sizes_have_the_shortest_digits() {
        let mut bits = 1u64;
        for _ in 0..100_000 {
            // An odd multiplier: a walk through patterns of all sizes.
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            for x in [f64::from_bits(bits), 1e3 * (bits as f64 / u64::MAX as f64 - 0.5)] {
                if x.is_finite() {
                    let written = real(x);
                    assert!(written.contains('.'), "{written}");
                    assert_eq!(written.parse::<f64>().unwrap().to_bits(), x.to_bits());
                    let digits = |text: &str| {
                        let mantissa = text.split(['e', 'E']).next().unwrap_or("");
                        let digits: String = mantissa.chars().filter(char::is_ascii_digit).collect();
                        digits.trim_matches('0').len()
                    };
                    assert_eq!(digits(&written), digits(&format!("{x:?}")), "{written} for {x:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_pushed_leaves_the_line_before_it() {
        let mut line = String::from("1e5,");
        [-1.5e-7, 2.0, 3e20].into_iter().for_each(|x| push_real(&mut line, x));
        push_number(&mut line, 12);
        assert_eq!(line, "1e5,-1.5E-72.03.E+2012");
        assert_eq!(references(&[1, 23]), "(#1,#23)");
    }

    #[test]
    fn strings_are_escaped() {
        assert_eq!(text("it's \u{e9}"), "it''s \\X2\\00E9\\X0\\");
    }
}
