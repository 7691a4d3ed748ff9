/*
 * Sentences about verdicts. A program that does not call lightpath_verdict_text does not need this file.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_manifest.h"

const char *lightpath_verdict_text(lightpath_verdict verdict)
{
    switch (verdict) {
    case LIGHTPATH_TRUSTED:
        return "Everything is right.";
    case LIGHTPATH_DOCUMENT_TOO_LARGE:
        return "The document has more than 4096 bytes.";
    case LIGHTPATH_DOCUMENT_NOT_TEXT:
        return "The document must be lines of printable ASCII, each with a line feed at its end.";
    case LIGHTPATH_DOCUMENT_OTHER_LINE:
        return "A line of the document is missing, or another stands in its place.";
    case LIGHTPATH_DOCUMENT_OTHER_VERSION:
        return "The document has another version of its format than this program reads.";
    case LIGHTPATH_DOCUMENT_WRONG_VALUE:
        return "The value of a line is not possible, or there are more than 8 lines of its kind.";
    case LIGHTPATH_DOCUMENT_TOO_LONG:
        return "The document has lines beyond its last one.";
    case LIGHTPATH_KEYRING_WRONG_SIGNATURE:
        return "The keyring is not signed by a root key of this device.";
    case LIGHTPATH_KEYRING_OLDER:
        return "The keyring has a lower version than that of this device.";
    case LIGHTPATH_KEYRING_DIFFERENT:
        return "The keyring has the version of that of this device, but says something else.";
    case LIGHTPATH_KEYRING_NOT_YET:
        return "The keyring does not count yet: is the clock late?";
    case LIGHTPATH_KEYRING_EXPIRED:
        return "The keyring counts no more: ask the server for the newest one.";
    case LIGHTPATH_KEY_UNKNOWN:
        return "The manifest's key is not in the keyring: ask the server for the newest one.";
    case LIGHTPATH_KEY_REVOKED:
        return "The manifest's key was revoked.";
    case LIGHTPATH_KEY_NOT_YET:
        return "The manifest's key does not count yet: is the clock late?";
    case LIGHTPATH_KEY_EXPIRED:
        return "The manifest's key counts no more.";
    case LIGHTPATH_MANIFEST_WRONG_SIGNATURE:
        return "The manifest's signature is wrong.";
    case LIGHTPATH_MANIFEST_NOT_YET:
        return "The manifest does not count yet: is the clock late?";
    case LIGHTPATH_MANIFEST_EXPIRED:
        return "The manifest counts no more: ask the server for the present one.";
    case LIGHTPATH_OTHER_DISPLAY:
        return "The manifest is for another display.";
    case LIGHTPATH_OTHER_OPTICS:
        return "The manifest is for another wavelength or another place.";
    case LIGHTPATH_OTHER_FORMAT:
        return "The manifest is about a file of another format.";
    case LIGHTPATH_LOWER_GENERATION:
        return "The manifest has a lower generation than the one that this device accepted before.";
    case LIGHTPATH_BODY_LONGER:
        return "The file is longer than the manifest says.";
    case LIGHTPATH_BODY_SHORTER:
        return "The file is shorter than the manifest says.";
    case LIGHTPATH_BODY_CORRUPT:
        return "The file is not the one of the manifest: its SHA-256 differs.";
    case LIGHTPATH_VERDICT_COUNT:
        break;
    }
    return "This number is no verdict.";
}
