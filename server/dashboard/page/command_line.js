// The beginning of commands that a page shows.

/** The server of the command line and of Python, if no other one is given. */
export const DEFAULT_SERVER = "http://127.0.0.1:7070";

/** The program of the command line, with the server of this page if it needs to be told. */
export const lightpath = () => `lightpath${location.origin === DEFAULT_SERVER ? "" : ` --server ${location.origin}`}`;
