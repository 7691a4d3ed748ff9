-- Displays. Holograms are made for them, and kernels are learned from them.
create table display (
    id             text    not null primary key check (length(id) between 1 and 63),
    -- all properties as JSON; equal displays have equal text
    content        text    not null check (json_valid(content)),
    create_time_ms integer not null
) strict, without rowid;
