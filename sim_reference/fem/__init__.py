"""The gel by finite elements with contact, as in section 2.2.1 of the paper: `FemGel`, a `deformation.GelModel`.

| what | here |
|---|---|
| graded, nested tetrahedra | `mesh` |
| elastic energy | `neo_hookean` |
| contact without penetration | `barrier`, against the object as a `height_field` |
| friction | `friction` |
| 3 x 3 matrices by the many | `matrices` |
| sums over the mesh | `assembly` |
| linear systems | `multigrid` |
| projected Newton's method | `newton` |
| a press, from depth or load to force and surface | `gel.FemGel` |
| then a drag, a twist, a roll | `dragging` |
| the surface on a grid | `sampling` |
| beside them: an elastic layer of small strain along itself, with friction | `tangential` |

Lengths are mm, and stresses are in units of the gel's shear modulus, so forces are in shear moduli times mm2.
"""
