//! Times and sizes in few digits, for the page and for whoever tells of a run elsewhere.

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
        assert_eq!(duration(0.0), "0 ms");
        assert_eq!(duration(0.34), "340 ms");
        assert_eq!(duration(1.25), "1.2 s");
        assert_eq!(duration(125.0), "2 min 5 s");
        assert_eq!(size(999), "999 B");
        assert_eq!(size(1_234_567), "1.2 MB");
        assert_eq!(size(2_000_000_000_000), "2.0 TB");
    }
}
