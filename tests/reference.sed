# ism.hpp as Doxygen reads it: the comments of its public part are written to be read in the file.

# The opening comment is the main page, below what most readers look for.
1i\
/** \\mainpage ism.hpp\
Distortion-minimizing injective maps between surfaces.\
\
| to                                 | see |\
| ---------------------------------- | --- |\
| map one mesh onto another          | ism::compute_map(), which returns an ism::Result |\
| do so in steps, stop, save, change | ism::Solver |\
| say how                            | ism::Options, ism::Tuning, ism::DistortionMeasure |\
| ask where points and curves go     | ism::SurfaceMap |\
| hand over meshes                   | ism::MeshView, ism::TriangleMesh, ism::Landmark |\
| see what is wrong with a mesh      | ism::validate(), ism::prepare() |\
| know how a call ended              | ism::Status, ism::Outcome, ism::is_usable() |\
| carry attributes, remesh, morph    | ism::transfer(), ism::remesh(), ism::MetaMesh |\
| have a map proved                  | ism::verify_map() |\
\
All functions and types are in the namespace ism. This is how the header begins:\
\\verbatim
1,/^#ifndef ISM_HPP/{
  /^#ifndef/i\
\\endverbatim */
  s|^// ?||
  b
}

# What is for the linker, and for the header itself.
/^#define (ISM_HPP|ISM_ABI)/d
/^inline namespace ISM_ABI/d
/^}  \/\/ namespace ISM_ABI/d

# An example is indented by two columns.
s|^( *///)   |\1      |
# What stands behind a declaration, and below that behind nothing, is about it.
s|^( *[^ /#}].*[^ ]) +// |\1  ///< |
s|^ {8,}// |  ///< |
# What is not meant as a mark: #V is a number, and no quotation begins with "> 0".
/\/\/\//s/#([A-Z×])/\\#\1/g
s|^( *///) >|\1 \\>|
