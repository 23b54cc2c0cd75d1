//! `report.html`: what a run has made, in one file that can be mailed.
//!
//! A [`Document`] says everything that is to be seen: the stages of a run with their times and parameters, the figures of
//! `report.json`, histograms, and a [`Scene`] of surfaces, lines and points. [`html`] writes it as one page with its
//! style, its viewer (plain WebGL 2) and its geometry inside.
//!
//! Guarantees: the page asks for nothing over the network, and its content security policy forbids it to; everything but
//! the three-dimensional view is plain HTML and can be read without scripts and with a screen reader; figures that this
//! crate has never heard of are shown under their own names; text from outside is escaped.
//!
//! Not guaranteed: coordinates beyond 16 bits. Positions are rounded to the box of the scene over 65,535, so 2.5
//! micrometres on a part of 160 mm: for the eye. Figures are computed elsewhere, from what is not rounded.
//!
//! ```
//! use topipe_report::{Document, Scene, Surface, html};
//! use topipe_mesh::TriangleMesh;
//! let triangle = TriangleMesh::from_arrays(
//!     vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
//!     vec![[0, 1, 2]],
//! );
//! let scene = Scene { surfaces: vec![Surface::new("mesh", "Mesh", triangle)], ..Scene::default() };
//! let scene = (&scene).into();
//! let page = html(&Document { title: "a <triangle>".into(), scene, ..Document::default() });
//! assert!(page.starts_with("<!DOCTYPE html>") && page.contains("a &lt;triangle&gt;"));
//! ```

mod document;
mod encode;
pub mod figures;
mod histogram;
mod page;
mod scene;

pub use document::{Document, Export, Figures, Outcome, Parameter, Picture, Stage};
pub use encode::EncodedScene;
pub use histogram::Histogram;
pub use page::html;
pub use scene::{Categories, ColorMaps, Field, Label, Lines, Points, Scene, Surface};
