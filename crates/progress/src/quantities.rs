//! Numbers, times and sizes in few digits, as people read them.

/// Four digits, without an exponent where none is needed; "unknown" for what is no number.
pub fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        a if (1e-3..1e4).contains(&a) => {
            let digits = (3 - a.log10().floor() as i32).clamp(0, 6) as usize;
            format!("{x:.digits$}")
        }
        a if (1e4..1e15).contains(&a) => format!("{x:.0}"),
        _ if x.is_finite() => format!("{x:.2e}"),
        _ => "unknown".to_owned(),
    }
}

/// "1.2 s", "340 ms", "2 min 5 s".
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 0.0005 => "0 ms".into(),
        s if s < 1.0 => format!("{:.0} ms", s * 1e3),
        s if s < 100.0 => format!("{s:.1} s"),
        s => format!("{:.0} min {:.0} s", (s / 60.0).floor(), s % 60.0),
    }
}

/// "12 B", "3.4 MB". Units are powers of 1000.
pub fn size(bytes: u64) -> String {
    let mut value = bytes as f64;
    for unit in ["B", "kB", "MB", "GB"] {
        if value < 1000.0 {
            return if unit == "B" { format!("{bytes} B") } else { format!("{value:.1} {unit}") };
        }
        value /= 1000.0;
    }
    format!("{value:.1} TB")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_digits_and_a_unit() {
        assert_eq!(
            [0.0, 0.012_345, 6.0, 1234.56, 123_456.7].map(number),
            ["0", "0.01235", "6.000", "1235", "123457"]
        );
        assert_eq!([-2.5e-7, f64::NAN, f64::INFINITY].map(number), ["-2.50e-7", "unknown", "unknown"]);
        assert_eq!(duration(0.0), "0 ms");
        assert_eq!(duration(0.34), "340 ms");
        assert_eq!(duration(1.25), "1.2 s");
        assert_eq!(duration(125.0), "2 min 5 s");
        assert_eq!(size(999), "999 B");
        assert_eq!(size(1_234_567), "1.2 MB");
        assert_eq!(size(2_000_000_000_000), "2.0 TB");
    }
}
