//! Writes STEP files (ISO 10303-21) with one product of solids, in application protocol 214 or 242.
//!
//! [`Entities::begin`] writes the header, the product and the units; the caller adds its geometry, bundles closed shells to
//! solids ([`Entities::solid`]), and ends the file ([`Entities::represent`], [`Entities::end`]). What curves and surfaces
//! there are is the caller's: this crate knows points, directions and coordinate systems only.
//!
//! Lengths are in mm, angles in radians. Numbers are written with the shortest digits that read back to the same bits, and the file
//! holds no date: the same calls give the same bytes. Nothing checks that references exist or that shells are closed.
//!
//! ```
//! use topipe_step::{Entities, Product, Protocol};
//! let product = Product { name: "part", description: "a part", protocol: Protocol::Ap214, uncertainty: 1e-7 };
//! let mut bytes = Vec::new();
//! let mut file = Entities::begin(&mut bytes, &product).unwrap();
//! let axes = file.placement(glam::DVec3::ZERO, glam::DVec3::Z, glam::DVec3::X).unwrap();
//! file.represent(&[axes]).unwrap();
//! file.end().unwrap();
//! assert!(bytes.starts_with(b"ISO-10303-21;"));
//! ```

mod spelling;

pub use spelling::{real, references, text};

use glam::DVec3;
use rustc_hash::FxHashMap;
use spelling::{push_number, push_real};
use std::io::{self, Write};

/// Which application protocol a file follows. The geometry is the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Protocol {
    /// AP214, *automotive design*: what every CAD system reads.
    #[default]
    Ap214,
    /// AP242, *managed model-based 3D engineering*, its successor.
    Ap242,
}

impl Protocol {
    /// Schema, application, short name of the protocol, year.
    fn names(self) -> [&'static str; 4] {
        match self {
            Self::Ap214 => [
                "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
                "core data for automotive mechanical design processes",
                "automotive_design",
                "2000",
            ],
            Self::Ap242 => [
                "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
                "managed model based 3d engineering",
                "ap242_managed_model_based_3d_engineering",
                "2014",
            ],
        }
    }
}

/// What a file is about.
#[derive(Debug, Clone, Copy)]
pub struct Product<'a> {
    /// Name of the product and of its solids.
    pub name: &'a str,
    /// One line for people, in the header.
    pub description: &'a str,
    /// The protocol.
    pub protocol: Protocol,
    /// Distance below which points are the same, as told to readers, mm.
    pub uncertainty: f64,
}

/// The data section of a file: writes entities and counts them. All errors are those of the writer.
#[derive(Debug)]
pub struct Entities<'a, W: Write> {
    out: &'a mut W,
    next: u64,
    /// The name of the product as the file spells it.
    name: String,
    /// The shape of the product, and the context of its units.
    shape: u64,
    units: u64,
    /// Points by their coordinates: what is the same place bit for bit is one entity.
    points: FxHashMap<[u64; 3], u64>,
    /// A line that is being put together.
    line: String,
    plane_context: Option<u64>,
}

impl<'a, W: Write> Entities<'a, W> {
    /// Writes the header and what says that the file is about one part in mm.
    pub fn begin(out: &'a mut W, product: &Product<'_>) -> io::Result<Self> {
        let name = text(product.name);
        let description = text(product.description);
        let [schema, application, short, year] = product.protocol.names();
        writeln!(out, "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('{description}'),'2;1');")?;
        writeln!(out, "FILE_NAME('{name}','1970-01-01T00:00:00',(''),(''),'topipe','topipe','');")?;
        writeln!(out, "FILE_SCHEMA(('{schema}'));\nENDSEC;\nDATA;")?;
        let mut file = Self {
            out,
            next: 1,
            name,
            shape: 0,
            units: 0,
            points: FxHashMap::default(),
            line: String::new(),
            plane_context: None,
        };
        let name = &file.name.clone();
        let context = file.add(&format!("APPLICATION_CONTEXT('{application}')"))?;
        file.add(&format!(
            "APPLICATION_PROTOCOL_DEFINITION('international standard','{short}',{year},#{context})"
        ))?;
        let product_context = file.add(&format!("PRODUCT_CONTEXT('',#{context},'mechanical')"))?;
        let part = file.add(&format!("PRODUCT('{name}','{name}','',(#{product_context}))"))?;
        file.add(&format!("PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{part}))"))?;
        let formation = file.add(&format!("PRODUCT_DEFINITION_FORMATION('','',#{part})"))?;
        let design =
            file.add(&format!("PRODUCT_DEFINITION_CONTEXT('part definition',#{context},'design')"))?;
        let definition = file.add(&format!("PRODUCT_DEFINITION('design','',#{formation},#{design})"))?;
        file.shape = file.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{definition})"))?;
        let length = file.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")?;
        let angle = file.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")?;
        let solid_angle = file.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")?;
        let uncertainty = file.add(&format!(
            "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({}),#{length},'distance_accuracy_value','')",
            real(product.uncertainty)
        ))?;
        file.units = file.add(&format!(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{uncertainty}))GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid_angle}))REPRESENTATION_CONTEXT('',''))"
        ))?;
        Ok(file)
    }

    /// Writes an entity; returns its number.
    pub fn add(&mut self, entity: &str) -> io::Result<u64> {
        let id = self.next;
        self.next += 1;
        writeln!(self.out, "#{id}={entity};")?;
        Ok(id)
    }

    /// A point. The same coordinates are one entity, however often they are asked for.
    pub fn point(&mut self, p: DVec3) -> io::Result<u64> {
        let key = p.to_array().map(f64::to_bits);
        if let Some(&id) = self.points.get(&key) {
            return Ok(id);
        }
        let id = self.single_point(p)?;
        self.points.insert(key, id);
        Ok(id)
    }

    /// A point that nothing else will ask for, as the inner control points of a surface: an entity of its own, which is not
    /// remembered. They are most of the points of a file.
    pub fn single_point(&mut self, p: DVec3) -> io::Result<u64> {
        let id = self.next;
        self.next += 1;
        let line = &mut self.line;
        line.clear();
        line.push('#');
        push_number(line, id);
        line.push_str("=CARTESIAN_POINT('',(");
        for (k, x) in p.to_array().into_iter().enumerate() {
            line.push_str(if k > 0 { "," } else { "" });
            push_real(line, x);
        }
        line.push_str("));\n");
        self.out.write_all(line.as_bytes())?;
        Ok(id)
    }

    /// A direction, which should have unit length.
    pub fn direction(&mut self, d: DVec3) -> io::Result<u64> {
        self.add(&format!("DIRECTION('',({},{},{}))", real(d.x), real(d.y), real(d.z)))
    }

    /// A coordinate system with the given third and first axes.
    pub fn placement(&mut self, origin: DVec3, z: DVec3, x: DVec3) -> io::Result<u64> {
        let (origin, z, x) = (self.point(origin)?, self.direction(z)?, self.direction(x)?);
        self.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
    }

    /// The context of the product's units.
    pub fn units(&self) -> u64 {
        self.units
    }

    /// The context of curves in the parameters of a surface.
    pub fn plane_context(&mut self) -> io::Result<u64> {
        if let Some(id) = self.plane_context {
            return Ok(id);
        }
        let id = self.add(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('2D SPACE',''))",
        )?;
        self.plane_context = Some(id);
        Ok(id)
    }

    /// A closed shell of faces.
    pub fn closed_shell(&mut self, faces: &[u64]) -> io::Result<u64> {
        self.add(&format!("CLOSED_SHELL('',{})", references(faces)))
    }

    /// A solid of an outer shell and the shells of its cavities. The faces of a cavity look into it: their shells are taken
    /// as they are.
    pub fn solid(&mut self, outer: u64, cavities: &[u64]) -> io::Result<u64> {
        let mut voids = Vec::with_capacity(cavities.len());
        for shell in cavities {
            voids.push(self.add(&format!("ORIENTED_CLOSED_SHELL('',*,#{shell},.T.)"))?);
        }
        let name = &self.name;
        let entity = if voids.is_empty() {
            format!("MANIFOLD_SOLID_BREP('{name}',#{outer})")
        } else {
            format!("BREP_WITH_VOIDS('{name}',#{outer},{})", references(&voids))
        };
        self.add(&entity)
    }

    /// Says what the product consists of: a coordinate system and solids.
    pub fn represent(&mut self, items: &[u64]) -> io::Result<()> {
        let (name, units, shape) = (&self.name, self.units, self.shape);
        let entity = format!("ADVANCED_BREP_SHAPE_REPRESENTATION('{name}',{},#{units})", references(items));
        let representation = self.add(&entity)?;
        self.add(&format!("SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})"))?;
        Ok(())
    }

    /// Ends the file.
    pub fn end(self) -> io::Result<()> {
        writeln!(self.out, "ENDSEC;\nEND-ISO-10303-21;")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(protocol: Protocol) -> String {
        let product = Product { name: "a 'b'", description: "what it is", protocol, uncertainty: 1e-7 };
        let mut bytes = Vec::new();
        let mut file = Entities::begin(&mut bytes, &product).unwrap();
        let axes = file.placement(DVec3::ZERO, DVec3::Z, DVec3::X).unwrap();
        let point = file.point(DVec3::ONE).unwrap();
        let single = file.single_point(DVec3::ONE).unwrap();
        assert_eq!(file.point(DVec3::ONE).unwrap(), point);
        assert_ne!(single, point);
        let [outer, cavity] = [1, 2].map(|face| file.closed_shell(&[face]).unwrap());
        let plain = file.solid(outer, &[]).unwrap();
        let hollow = file.solid(outer, &[cavity]).unwrap();
        file.represent(&[axes, plain, hollow]).unwrap();
        file.end().unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn every_reference_but_the_made_up_faces_is_to_an_entity_before_it() {
        let text = file(Protocol::Ap214);
        let mut known = 0;
        for line in text.lines().filter(|line| line.starts_with('#')) {
            let (id, entity) = line[1..].split_once('=').unwrap();
            let id: u64 = id.parse().unwrap();
            assert_eq!(id, known + 1);
            for reference in entity.split('#').skip(1) {
                let digits: String = reference.chars().take_while(char::is_ascii_digit).collect();
                assert!(digits.parse::<u64>().unwrap() < id, "{line}");
            }
            known = id;
        }
        assert!(text.starts_with("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('what it is'),'2;1');\n"));
        assert!(text.ends_with(";\nENDSEC;\nEND-ISO-10303-21;\n"));
        assert!(text.contains("PRODUCT('a ''b''','a ''b''',''"));
        assert_eq!(text.matches("CARTESIAN_POINT").count(), 3);
        assert_eq!(
            (text.matches("MANIFOLD_SOLID_BREP").count(), text.matches("BREP_WITH_VOIDS").count()),
            (1, 1)
        );
    }

    #[test]
    fn protocols_differ_in_their_names_only() {
        let [old, new] = [Protocol::Ap214, Protocol::Ap242].map(file);
        assert!(
            old.contains("AUTOMOTIVE_DESIGN") && new.contains("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING")
        );
        let differ = old.lines().zip(new.lines()).filter(|(a, b)| a != b).count();
        assert_eq!((old.lines().count(), differ), (new.lines().count(), 3));
    }
}
