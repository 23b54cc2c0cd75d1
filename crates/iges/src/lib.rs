//! Writes IGES files (version 5.3, ANS US PRO/IPO-100-1996) of entities in mm.
//!
//! A [`File`] takes entities one by one ([`File::add`]) and is written at the end, because the directory, which names the
//! lines of each entity's parameters, comes before the parameters. Which entities there are is the caller's: this crate
//! knows lines of 80 columns, numbers and texts only.
//!
//! Numbers are written with the shortest digits that read back to the same bits, as double precision where they have an
//! exponent, and the file holds no date: the same calls give the same bytes. Nothing checks that references exist.
//!
//! ```
//! use topipe_iges::{Entity, File, Parameters, Product};
//! let mut file = File::default();
//! let line = Parameters::of(110).points(&[glam::DVec3::ZERO, glam::DVec3::X]);
//! file.add(&Entity::default(), line).unwrap();
//! let mut bytes = Vec::new();
//! file.write(&Product { name: "part", resolution: 1e-7, largest: 1.0 }, "one line", &mut bytes).unwrap();
//! assert!(bytes.split(|&b| b == b'\n').all(|line| line.is_empty() || line.len() == 80));
//! ```

use glam::DVec3;
use std::io::{self, Write};

/// Columns of a line that hold parameters; the rest names the entity and counts the lines.
const COLUMNS: usize = 64;
/// Lines of a section are counted with seven digits.
const MOST_LINES: usize = 9_999_999;

/// What a file is about.
#[derive(Debug, Clone, Copy)]
pub struct Product<'a> {
    /// Name of the product.
    pub name: &'a str,
    /// Distance below which points are the same, as told to readers, mm.
    pub resolution: f64,
    /// No coordinate is larger, mm.
    pub largest: f64,
}

/// What the directory says of an entity beside its type.
#[derive(Debug, Clone, Copy, Default)]
pub struct Entity<'a> {
    /// Which of the forms of its type it is.
    pub form: u32,
    /// The entity of its transformation (124); 0 for none.
    pub transformation: u32,
    /// The entity of its colour (314); 0 for none.
    pub color: u32,
    /// Whether it stands for itself. All others belong to an entity that refers to them.
    pub independent: bool,
    /// What it is used for: 0 geometry, 2 definition, 5 in the parameters of a surface.
    pub used_for: u32,
    /// A name of at most eight letters, and a number.
    pub label: (&'a str, u32),
}

/// The parameters of one entity, in lines that break between them.
#[derive(Debug, Clone)]
pub struct Parameters {
    kind: u32,
    /// Lines of [`COLUMNS`] columns one after the other; the last one may be shorter.
    text: String,
}

impl Parameters {
    /// Of an entity of this type.
    pub fn of(kind: u32) -> Self {
        Self { kind, text: kind.to_string() }
    }

    /// A value with the delimiter before it, in one line.
    fn push(&mut self, value: &str) {
        self.text.push(',');
        let used = self.text.len() % COLUMNS;
        // Room for the delimiter that follows, too.
        if used != 0 && used + value.len() + 1 > COLUMNS {
            self.text.extend(std::iter::repeat_n(' ', COLUMNS - used));
        }
        self.text.push_str(value);
    }

    /// A whole number, or an entity.
    #[must_use]
    pub fn integer(mut self, value: impl Into<i64>) -> Self {
        self.push(&value.into().to_string());
        self
    }

    /// Whole numbers, or entities.
    #[must_use]
    pub fn integers<T: Into<i64>>(self, values: impl IntoIterator<Item = T>) -> Self {
        values.into_iter().fold(self, Self::integer)
    }

    /// A number.
    #[must_use]
    pub fn real(mut self, value: f64) -> Self {
        self.push(&real(value));
        self
    }

    /// Numbers.
    #[must_use]
    pub fn reals(self, values: impl IntoIterator<Item = f64>) -> Self {
        values.into_iter().fold(self, Self::real)
    }

    /// The coordinates of points.
    #[must_use]
    pub fn points(self, points: &[DVec3]) -> Self {
        self.reals(points.iter().flat_map(|p| p.to_array()))
    }
}

/// Entities, to be written.
#[derive(Debug, Clone, Default)]
pub struct File {
    directory: String,
    parameters: String,
    entities: usize,
    lines: usize,
}

impl File {
    /// Adds an entity; returns the number by which others refer to it. Fails where the file would have more lines than the
    /// format can count.
    pub fn add(&mut self, entity: &Entity<'_>, mut parameters: Parameters) -> io::Result<u32> {
        parameters.text.push(';');
        let lines = parameters.text.len().div_ceil(COLUMNS);
        let number = 2 * self.entities + 1;
        if number + 1 > MOST_LINES || self.lines + lines > MOST_LINES {
            let most =
                format!("it has more than {MOST_LINES} lines, which IGES cannot count: write STEP instead");
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, most));
        }
        let Entity { form, transformation, color, independent, used_for, label: (label, subscript) } =
            *entity;
        let (kind, first) = (parameters.kind, self.lines + 1);
        let color = -i64::from(color);
        let belongs = u32::from(!independent);
        let status = format!("00{belongs:02}{used_for:02}{belongs:02}");
        let label: String = label.chars().filter(char::is_ascii_alphanumeric).take(8).collect();
        self.directory += &format!(
            "{kind:8}{first:8}{:8}{:8}{:8}{:8}{transformation:8}{:8}{status}D{number:7}\n",
            0, 1, 0, 0, 0
        );
        self.directory += &format!(
            "{kind:8}{:8}{color:8}{lines:8}{form:8}{:16}{label:>8}{subscript:8}D{:7}\n",
            0,
            "",
            number + 1
        );
        for k in 0..lines {
            let line = &parameters.text[k * COLUMNS..((k + 1) * COLUMNS).min(parameters.text.len())];
            self.parameters += &format!("{line:64}{number:8}P{:7}\n", first + k);
        }
        self.lines += lines;
        self.entities += 1;
        Ok(number as u32)
    }

    /// Writes all sections. `remark` is one line for people.
    pub fn write(&self, product: &Product<'_>, remark: &str, out: &mut impl Write) -> io::Result<()> {
        let remark: String = ascii(remark).chars().take(72).collect();
        writeln!(out, "{remark:72}S{:7}", 1)?;
        let mut global = String::new();
        let name = ascii(product.name);
        // No date: the file is that of its content.
        let date = text("19700101.000000");
        let fields = [
            text(","),
            text(";"),
            text(&name),
            text(&format!("{name}.igs")),
            text("topipe"),
            text("topipe"),
            // Bits of whole numbers, then powers and digits of single and of double precision.
            "32".into(),
            "38".into(),
            "6".into(),
            "308".into(),
            "15".into(),
            text(&name),
            // Scale, and millimetres.
            "1.".into(),
            "2".into(),
            text("MM"),
            "1".into(),
            real(product.largest / 1000.0),
            date.clone(),
            real(product.resolution),
            real(product.largest),
            // Author and organization are left out. Version 5.3, no drafting standard.
            String::new(),
            String::new(),
            "11".into(),
            "0".into(),
            date,
        ];
        for (k, field) in fields.iter().enumerate() {
            global += field;
            global.push(if k + 1 < fields.len() { ',' } else { ';' });
        }
        // Texts may run on in the next line.
        let lines = global.len().div_ceil(72);
        for k in 0..lines {
            writeln!(out, "{:72}G{:7}", &global[72 * k..(72 * (k + 1)).min(global.len())], k + 1)?;
        }
        out.write_all(self.directory.as_bytes())?;
        out.write_all(self.parameters.as_bytes())?;
        writeln!(out, "S{:7}G{lines:7}D{:7}P{:7}{:40}T{:7}", 1, 2 * self.entities, self.lines, "", 1)
    }
}

/// A text with its length, as the format wants it.
fn text(s: &str) -> String {
    format!("{}H{s}", s.len())
}

/// What is no printable ASCII becomes a low line.
fn ascii(s: &str) -> String {
    s.chars().map(|c| if (' '..='~').contains(&c) { c } else { '_' }).collect()
}

/// A number with a decimal point, its exponent as that of double precision. Reads back to the same bits but for the sign of 0.
fn real(x: f64) -> String {
    // `+ 0.0` takes the sign from a negative zero.
    let shortest = format!("{:?}", x + 0.0);
    match shortest.split_once('e') {
        None => shortest,
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}D{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.D{exponent}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(file: &File) -> Vec<String> {
        let mut bytes = Vec::new();
        let product = Product { name: "a part, \u{e9}", resolution: 1e-7, largest: 250.0 };
        file.write(&product, "what it is", &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn lines_have_80_columns_and_are_counted_by_section() {
        let mut entities = File::default();
        let points: Vec<DVec3> = (0..40).map(|k| DVec3::new(f64::from(k) / 3.0, 1e-9, -1.5)).collect();
        let many = entities.add(&Entity::default(), Parameters::of(502).integer(40).points(&points)).unwrap();
        let next = Entity { label: ("HOLE", 3), independent: true, ..Entity::default() };
        assert_eq!((many, entities.add(&next, Parameters::of(116).integer(many)).unwrap()), (1, 3));
        let lines = file(&entities);
        let mut counts = std::collections::BTreeMap::new();
        for line in &lines {
            assert_eq!(line.len(), 80, "{line}");
            let count = counts.entry(line.as_bytes()[72]).or_insert(0);
            *count += 1;
            assert_eq!(line[73..].trim().parse::<usize>().unwrap(), *count);
        }
        let last = lines.last().unwrap();
        let told = |at: usize| last[at..at + 7].trim().parse::<usize>().unwrap();
        assert_eq!([told(1), told(9), told(17), told(25)], [b'S', b'G', b'D', b'P'].map(|s| counts[&s]));
        // Every value is in one line, and comes back.
        let parameters: Vec<&str> =
            lines.iter().filter(|l| &l[72..73] == "P").map(|l| l[..64].trim()).collect();
        assert!(parameters.iter().all(|line| line.ends_with([',', ';'])));
        let read: Vec<f64> = parameters[..parameters.len() - 1]
            .concat()
            .trim_end_matches(';')
            .split(',')
            .skip(2)
            .map(|x| x.replace('D', "e").parse().unwrap())
            .collect();
        assert_eq!(read, points.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>());
        let directory: Vec<&String> = lines.iter().filter(|l| &l[72..73] == "D").collect();
        assert!(directory[0].starts_with("     502       1") && directory[2][64..72] == *"00000000");
        assert_eq!(directory[3][56..72], *"    HOLE       3");
    }

    #[test]
    fn texts_have_their_lengths() {
        let global: String = file(&File::default())
            .iter()
            .filter(|line| &line[72..73] == "G")
            .map(|line| line[..72].to_owned())
            .collect();
        assert!(global.starts_with("1H,,1H;,9Ha part, _,13Ha part, _.igs,6Htopipe,"), "{global}");
        assert!(global.contains(",1.,2,2HMM,1,0.25,15H19700101.000000,1.D-7,250.0,,,11,0,15H1970"));
    }
}
