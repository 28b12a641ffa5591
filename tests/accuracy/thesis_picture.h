// The 220-cell scene of the thesis as a picture.

#ifndef FATHOM_TESTS_ACCURACY_THESIS_PICTURE_H_
#define FATHOM_TESTS_ACCURACY_THESIS_PICTURE_H_

#include <string>

#include "tests/accuracy/terrain.h"

namespace fathom::accuracy {

// Draws the leaves of FirstThesisWindow (tests/accuracy/thesis_scene.h) as a
// PNG. False: there is no such window, or it cannot be written.
bool DrawThesisScene(const Terrain& terrain, const std::string& path);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_THESIS_PICTURE_H_
