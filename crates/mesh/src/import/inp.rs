//! Decks of CalculiX and Abaqus: the surface of solid elements, all of them or those of one set; or a surface of shells.
//!
//! Optimizers write the elements that are left as a deck, or all elements with a set of those that are left.

use super::density::{Cells, surface_of_cells, wrong};
use super::soup::{Soup, excerpt, lines, number};
use super::{ImportError, ImportOptions};
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};

/// Whether the content is such a file: what is no comment begins with a keyword.
pub(super) fn looks_like(start: &[u8]) -> bool {
    let first = lines(start).map(|(_, line)| line).find(|line| !line.is_empty() && !line.starts_with(b"**"));
    first.is_some_and(|line| line.first() == Some(&b'*') && line.get(1).is_some_and(u8::is_ascii_alphabetic))
}

/// VTK's kind of a solid element, and how many nodes are listed. The nodes of a wedge stand the other way round there.
fn solid(name: &str) -> Option<(u8, usize)> {
    let nodes = name.strip_prefix("C3D").or_else(|| name.strip_prefix("DC3D"))?;
    match nodes.trim_end_matches(|c: char| c.is_ascii_alphabetic()) {
        "4" => Some((10, 4)),
        "10" => Some((24, 10)),
        "8" => Some((12, 8)),
        "20" => Some((25, 20)),
        "6" => Some((13, 6)),
        "15" => Some((13, 15)),
        _ => None,
    }
}

/// Corners and nodes of an element that is a face.
fn face(name: &str) -> Option<(usize, usize)> {
    let name = name.trim_end_matches('R');
    match name {
        "S3" | "STRI3" | "M3D3" | "SFM3D3" => Some((3, 3)),
        "S4" | "M3D4" | "SFM3D4" => Some((4, 4)),
        "S6" | "STRI65" | "M3D6" => Some((3, 6)),
        "S8" | "M3D8" => Some((4, 8)),
        _ => None,
    }
}

/// What the lines behind a keyword are.
enum Block {
    Nodes,
    /// Kind of the elements (`Err` with corners for faces), nodes of each, and their set.
    Elements(Result<u8, usize>, usize, Option<String>),
    /// Members, or first, last and step.
    Set(String, bool),
    Other,
}

#[derive(Default)]
struct Elements {
    ids: Vec<u64>,
    kinds: Vec<u8>,
    corners: Vec<u32>,
    ends: Vec<usize>,
}

/// What a line that begins with a star announces, or what is wrong with it.
fn keyword(line: &[u8]) -> Result<Block, String> {
    let line = String::from_utf8_lossy(line).to_ascii_uppercase();
    let mut parts = line.split(',').map(str::trim);
    let name = parts.next().unwrap_or_default();
    let parameters: Vec<(&str, &str)> =
        parts.map(|part| part.split_once('=').map_or((part, ""), |(k, v)| (k.trim(), v.trim()))).collect();
    let get = |name: &str| parameters.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    match name {
        "*NODE" => Ok(Block::Nodes),
        "*ELEMENT" => {
            let kind = get("TYPE").unwrap_or_default();
            let set = get("ELSET").map(str::to_owned);
            match (solid(kind), face(kind)) {
                (Some((kind, nodes)), _) => Ok(Block::Elements(Ok(kind), nodes, set)),
                (_, Some((corners, nodes))) => Ok(Block::Elements(Err(corners), nodes, set)),
                // Beams, springs, masses bound no material.
                _ if ["B", "T", "SPRING", "MASS", "GAP", "DASHPOT", "R"]
                    .iter()
                    .any(|k| kind.starts_with(k)) =>
                {
                    Ok(Block::Other)
                }
                _ => Err(format!(
                    "elements of type \"{}\" are not read; C3D4, C3D6, C3D8, C3D10, C3D15, C3D20, S3 and S4 are",
                    excerpt(kind.as_bytes())
                )),
            }
        }
        "*ELSET" => match get("ELSET") {
            Some(set) => Ok(Block::Set(set.to_owned(), get("GENERATE").is_some())),
            None => Err("the set has no name".to_owned()),
        },
        "*INCLUDE" => Err("files that are included are not read; put them into one deck".to_owned()),
        _ => Ok(Block::Other),
    }
}

/// A number; an exponent may be that of Fortran's double precision.
fn real(item: &[u8]) -> Option<f64> {
    number(item).or_else(|| {
        number(
            &item.to_ascii_lowercase().iter().map(|&c| if c == b'd' { b'e' } else { c }).collect::<Vec<_>>(),
        )
    })
}

/// The first of some sets.
fn names(sets: &BTreeMap<String, Vec<(u64, u64, u64)>>) -> String {
    let names: Vec<&str> = sets.keys().map(String::as_str).take(8).collect();
    names.join(", ")
}

/// Reads a deck.
pub(super) fn parse(file: &str, bytes: &[u8], options: &ImportOptions) -> Result<Soup, ImportError> {
    let mut nodes: HashMap<u64, u32> = HashMap::new();
    let mut positions = Vec::new();
    let (mut solids, mut faces) = (Elements::default(), Elements::default());
    // Members by the name in upper case, as ranges with a step.
    let mut sets: BTreeMap<String, Vec<(u64, u64, u64)>> = BTreeMap::new();
    let mut block = Block::Other;
    // An element may go on in the next line.
    let mut open: Vec<u64> = Vec::new();
    for (number_of_line, line) in lines(bytes) {
        if line.is_empty() || line.starts_with(b"**") {
            continue;
        }
        let wrong = |problem: &str| wrong(file, &format!("line {number_of_line}"), problem);
        if line[0] == b'*' {
            if !open.is_empty() {
                return Err(wrong("the element before it has too few nodes"));
            }
            block = keyword(line).map_err(|problem| wrong(&problem))?;
            continue;
        }
        let items = line.split(|&b| b == b',').map(<[u8]>::trim_ascii).filter(|item| !item.is_empty());
        let id = |item: &[u8]| -> Result<u64, ImportError> {
            let text = std::str::from_utf8(item).ok().and_then(|text| text.parse().ok());
            text.ok_or_else(|| wrong(&format!("a number was expected, not \"{}\"", excerpt(item))))
        };
        match &block {
            Block::Other => {}
            Block::Nodes => {
                let items: Vec<&[u8]> = items.collect();
                let coordinate = |k: usize| match items.get(k) {
                    // What is left out is zero.
                    None => Ok(0.0),
                    Some(item) => real(item)
                        .ok_or_else(|| wrong(&format!("a number was expected, not \"{}\"", excerpt(item)))),
                };
                nodes.insert(id(items.first().copied().unwrap_or_default())?, positions.len() as u32);
                positions.push(DVec3::new(coordinate(1)?, coordinate(2)?, coordinate(3)?));
            }
            Block::Elements(kind, count, set) => {
                for item in items {
                    open.push(id(item)?);
                }
                if open.len() > count + 1 {
                    return Err(wrong(&format!("an element of {count} nodes has {}", open.len() - 1)));
                }
                if open.len() == count + 1 {
                    let (kind, corners, elements) = match kind {
                        Ok(kind) => (*kind, *count, &mut solids),
                        Err(corners) => (0, *corners, &mut faces),
                    };
                    for node in &open[1..=corners] {
                        let known = nodes.get(node);
                        let known =
                            known.ok_or_else(|| wrong(&format!("there is no node {node} before it")))?;
                        elements.corners.push(*known);
                    }
                    let own = elements.corners.len() - corners;
                    if kind == 13 {
                        elements.corners[own..own + 6].swap(1, 2);
                        elements.corners[own..own + 6].swap(4, 5);
                    }
                    elements.ends.push(elements.corners.len());
                    elements.kinds.push(kind);
                    elements.ids.push(open[0]);
                    if let Some(set) = set {
                        sets.entry(set.clone()).or_default().push((open[0], open[0], 1));
                    }
                    open.clear();
                }
            }
            Block::Set(name, true) => {
                let range: Vec<u64> = items.map(id).collect::<Result<_, _>>()?;
                let (&[first, last] | &[first, last, _]) = &range[..] else {
                    return Err(wrong("first, last and step were expected"));
                };
                let step = range.get(2).copied().unwrap_or(1).max(1);
                sets.entry(name.clone()).or_default().push((first, last, step));
            }
            Block::Set(name, false) => {
                for item in items {
                    let other = String::from_utf8_lossy(item).to_ascii_uppercase();
                    let members = match (id(item), sets.get(&other)) {
                        (Ok(id), _) => vec![(id, id, 1)],
                        // The name of a set that is known.
                        (Err(_), Some(members)) => members.clone(),
                        (Err(error), None) => return Err(error),
                    };
                    let set = sets.entry(name.clone()).or_default();
                    set.extend(members);
                    // Sets of sets of sets.
                    if set.len() > bytes.len() {
                        return Err(wrong(&format!(
                            "the set {name} has more members than the file has letters"
                        )));
                    }
                }
            }
        }
    }
    if !open.is_empty() {
        return Err(wrong(file, "the end", "the last element has too few nodes"));
    }
    if solids.ids.is_empty() {
        if faces.ids.is_empty() {
            return Err(wrong(
                file,
                "*ELEMENT",
                "there are neither solid elements (C3D4, C3D8 ...) nor shells",
            ));
        }
        return Soup::from_polygons(file, "INP", positions, &faces.corners, &faces.ends);
    }
    let members = |name: &str| -> Option<Vec<bool>> {
        let (_, ranges) = sets.iter().find(|(known, _)| known.eq_ignore_ascii_case(name))?;
        let mut ranges = ranges.clone();
        ranges.sort_unstable();
        let single: std::collections::HashSet<u64> =
            ranges.iter().filter(|r| r.0 == r.1).map(|r| r.0).collect();
        let wide: Vec<_> = ranges.into_iter().filter(|r| r.0 != r.1).collect();
        let within =
            |id: u64| wide.iter().any(|&(a, b, step)| id >= a && id <= b && (id - a).is_multiple_of(step));
        Some(solids.ids.iter().map(|&id| single.contains(&id) || within(id)).collect())
    };
    let field = match &options.field {
        None => None,
        Some(name) => {
            let kept = members(name).ok_or_else(|| {
                let problem = format!("there is no element set {name}; there are {}", names(&sets));
                wrong(file, "*ELSET", &problem)
            })?;
            Some((name.clone(), kept.into_iter().map(|kept| f64::from(u8::from(kept))).collect()))
        }
    };
    let passive = members("NON_DESIGN");
    let Elements { kinds, corners, ends, .. } = solids;
    let cells = Cells { format: "INP", positions, kinds, corners, ends, field, passive };
    // A set has no threshold.
    let mut soup = surface_of_cells(file, cells, &ImportOptions { threshold: None, ..options.clone() })?;
    soup.taken = match &options.field {
        None if sets.is_empty() => "all solid elements".to_owned(),
        None => format!("all solid elements; with `field` it may be an element set: {}", names(&sets)),
        Some(set) => format!("element set {set}"),
    };
    Ok(soup)
}
