//! Which reader a file goes to: by content first, then by ending.

use super::soup::{Soup, lines, words};
use super::{ImportError, ImportOptions, density, inp, legacy_vtk, obj, off, ply, stl, vtk};

/// Parses a file of any known format.
pub(super) fn parse(file: &str, bytes: &[u8], options: &ImportOptions) -> Result<Soup, ImportError> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let ending = file.rsplit_once('.').map_or(String::new(), |(_, e)| e.to_ascii_lowercase());
    if text.trim_ascii().is_empty() {
        return Err(ImportError::Empty { file: file.to_owned() });
    }
    // The length is the only sure sign of a binary STL: many start with "solid ", as ASCII ones do.
    if stl::has_binary_length(bytes) {
        return stl::parse_binary(file, bytes);
    }
    let start = text.trim_ascii_start();
    if ["ply\n", "ply\r", "ply "].iter().any(|magic| start.starts_with(magic.as_bytes())) {
        return ply::parse(file, start);
    }
    if vtk::looks_like(start) {
        return density::parse(file, start, options);
    }
    if legacy_vtk::looks_like(start) {
        return legacy_vtk::parse(file, start, options);
    }
    if inp::looks_like(start) {
        return inp::parse(file, start, options);
    }
    if off::has_header(start) {
        return off::parse(file, text);
    }
    if stl::looks_ascii(start) {
        return stl::parse_ascii(file, text);
    }
    match ending.as_str() {
        "stl" => stl::parse_binary(file, bytes),
        "off" => off::parse(file, text),
        "obj" => obj::parse(file, text),
        "ply" => Err(ImportError::Malformed {
            file: file.to_owned(),
            place: "line 1".to_owned(),
            problem: "a PLY file starts with the word ply".to_owned(),
        }),
        _ if lines(text).take(1000).any(|(_, l)| words(l).next() == Some(b"v")) => obj::parse(file, text),
        _ => Err(ImportError::UnknownFormat { file: file.to_owned() }),
    }
}
