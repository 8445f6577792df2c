//! The kinds of cells by the number that Gmsh gives them.

/// What is done with a kind of cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Four corners: taken as it is.
    Tetrahedron,
    /// Eight corners: cut into tetrahedra.
    Hexahedron,
    /// A point, a line or a face: it says nothing of the inside.
    Boundary,
    /// A volume that is not read; its name in words.
    Unread(&'static str),
}

/// The kind of Gmsh's element type `number`; `None` for the types after 31, which few programs write.
pub(super) fn kind(number: u64) -> Option<Kind> {
    Some(match number {
        4 => Kind::Tetrahedron,
        5 => Kind::Hexahedron,
        // Lines, triangles, quadrangles and points, of any order.
        1..=3 | 8..=10 | 15 | 16 | 20..=28 => Kind::Boundary,
        11 => Kind::Unread("tetrahedra of second order (10 nodes)"),
        29..=31 => Kind::Unread("tetrahedra of higher order"),
        12 | 17 => Kind::Unread("hexahedra of second order"),
        6 => Kind::Unread("prisms"),
        13 | 18 => Kind::Unread("prisms of second order"),
        7 => Kind::Unread("pyramids"),
        14 | 19 => Kind::Unread("pyramids of second order"),
        _ => return None,
    })
}
