//! How values are spelled.

/// A list of entities.
pub fn references(ids: &[u64]) -> String {
    let list: Vec<String> = ids.iter().map(|id| format!("#{id}")).collect();
    format!("({})", list.join(","))
}

/// A number as the standard wants it: with a decimal point, exponent as E. Reads back to the same bits.
pub fn real(x: f64) -> String {
    let shortest = format!("{x:?}");
    match shortest.split_once('e') {
        None => shortest,
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.E{exponent}"),
    }
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
    fn strings_are_escaped() {
        assert_eq!(text("it's \u{e9}"), "it''s \\X2\\00E9\\X0\\");
    }
}
