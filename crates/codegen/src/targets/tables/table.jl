
# Series in time at one position: where pieces begin and end, and coefficients of each polynomial, piece and entry.
struct Series
    knots::Vector{Float64}
    coefficients::Array{Float64,3}
end

# Fields of position and time: Chebyshev series in coordinates of the body, and in pieces of the time; or series of some points.
struct Table
    dimension::Int
    # For each field its shape and its entries.
    shapes::Vector{String}
    entries::Vector{UnitRange{Int}}
    chart::String
    frame::String
    # Axis, low end, high end, number of polynomials.
    axes::Vector{Tuple{Int,Float64,Float64,Int}}
    knots::Vector{Float64}
    # Nodes, polynomials in time, pieces, entries.
    coefficients::Array{Float64,4}
    places::Matrix{Float64}
    of_points::Vector{Series}
end

# Reads a table; sources and tables know each other by the digest.
function mmsmith_table(path)
    isfile(path) || throw(ArgumentError(MISSING))
    words = Iterators.Stateful(split(read(path, String)))
    take() = isempty(words) ? throw(ArgumentError(BROKEN)) : popfirst!(words)
    take_integer() = parse(Int, take())
    take_number() = parse(Float64, take())
    take() == "mmsmith-table" && take() == "1" && take() == "digest" || throw(ArgumentError(BROKEN))
    take() == DIGEST || throw(ArgumentError(ANOTHER))
    after(name) = take() == name || throw(ArgumentError(BROKEN))
    after("solution"); take()
    after("parameters")
    for _ in 1:take_integer()
        take(); take()
    end
    after("end"); take()
    after("error"); take()
    after("dimension"); d = take_integer()
    after("fields")
    shapes, entries, count = String[], UnitRange{Int}[], 0
    for _ in 1:take_integer()
        take()
        push!(shapes, String(take()))
        size_of = Dict("scalar" => 1, "vector" => d, "matrix" => d * d, "symmetric" => 6)[shapes[end]]
        push!(entries, count+1:count+size_of)
        count += size_of
    end
    after("chart"); chart = String(take())
    after("frame"); frame = String(take())
    none = (zeros(0, 0), Series[])
    if chart == "points"
        after("points")
        points = take_integer()
        places, of_points = zeros(d, points), Series[]
        for k in 1:points
            places[:, k] = [take_number() for _ in 1:d]
            pieces, in_time = take_integer(), take_integer()
            knots = [take_number() for _ in 0:pieces]
            push!(of_points, Series(knots, reshape([take_number() for _ in 1:in_time*pieces*count], in_time, pieces, count)))
        end
        return Table(d, shapes, entries, chart, frame, [], [0.0], zeros(0, 0, 0, 0), places, of_points)
    end
    after("axes")
    axes = [(take_integer() + 1, take_number(), take_number(), take_integer()) for _ in 1:take_integer()]
    after("pieces")
    pieces, in_time = take_integer(), take_integer()
    knots = [take_number() for _ in 0:pieces]
    after("coefficients")
    numbers = [take_number() for _ in 1:take_integer()]
    nodes = prod(last, axes)
    return Table(d, shapes, entries, chart, frame, axes, knots, reshape(numbers, nodes, in_time, pieces, count), none...)
end

function mmsmith_polynomials(x, n)
    values = fill(one(x), n)
    for k in 2:n
        values[k] = k == 2 ? x : 2 * x * values[k-1] - values[k-2]
    end
    return values
end

# The piece of a time and the polynomials there; not numbers before the start and after the end.
function mmsmith_moment(knots, in_time, t)
    pieces, last_time = length(knots) - 1, knots[end]
    piece = clamp(searchsortedlast(knots, t), 1, pieces)
    low, high = knots[piece], knots[piece+1]
    x = (2 * t - low - high) / (high - low)
    is_known = -1e-12 * last_time <= t <= last_time * (1 + 1e-12)
    return piece, mmsmith_polynomials(is_known ? x : oftype(x, NaN), in_time)
end

# The products of the polynomials of all axes at a position, for each node; not numbers far from the body.
function mmsmith_along(table, X)
    q = [X[i] for i in 1:table.dimension]
    if table.chart == "annulus" && table.dimension > 1
        from_axis, angle = sqrt(X[1]^2 + X[2]^2), atan(X[2], X[1])
        angle = angle < 0 ? angle + 2 * pi : angle
        q = table.dimension == 2 ? [from_axis, angle] : [sqrt(from_axis^2 + X[3]^2), atan(from_axis, X[3]), angle]
    end
    if table.chart == "tube"
        q = [sqrt(X[1]^2 + X[2]^2), atan(X[2], X[1]), X[3]]
    end
    basis = [one(q[1])]
    for (axis, low, high, count) in table.axes
        if table.chart == "tube" && axis == 2
            q[2] += 2 * pi * round(((low + high) / 2 - q[2]) / (2 * pi))
        end
        x = (2 * q[axis] - low - high) / (high - low)
        basis = kron(mmsmith_polynomials(abs(x) <= 1.1 ? x : oftype(x, NaN), count), basis)
    end
    return basis
end

# The entries of a field in Cartesian components.
function mmsmith_turned(table, X, shape, values)
    table.frame == "cartesian" || shape == "scalar" ? (return values) : nothing
    s = sqrt(X[1]^2 + X[2]^2)
    c, z = X[1] / s, zero(X[1])
    Q = [c -X[2]/s z; X[2]/s c z; z z one(z)]
    if table.frame == "spherical"
        r = sqrt(s^2 + X[3]^2)
        Q = [X[1]/r X[3]/r*c -X[2]/s; X[2]/r X[3]/r*X[2]/s c; X[3]/r -s/r z]
    end
    d = shape == "symmetric" ? 3 : table.dimension
    Q = Q[1:d, 1:d]
    shape == "vector" && return Q * values
    places = shape == "matrix" ? [(i - 1) * d + j for i in 1:d, j in 1:d] : [1 4 5; 4 2 6; 5 6 3]
    turned = Q * values[places] * transpose(Q)
    shape == "matrix" && return [turned[i, j] for i in 1:d for j in 1:d]
    return [turned[1, 1], turned[2, 2], turned[3, 3], turned[1, 2], turned[1, 3], turned[2, 3]]
end

# The number of a point of the table, by its position; nothing where there is no such point.
function mmsmith_point_of(table, X)
    least = 1e-12 * mapreduce(abs, max, table.places; init = 0.0)
    is_here(k) = all(abs(X[i] - table.places[i, k]) <= 1e-9 * abs(table.places[i, k]) + least for i in 1:table.dimension)
    return findfirst(is_here, 1:length(table.of_points))
end

function mmsmith_sum(own, t, entries)
    piece, of_time = mmsmith_moment(own.knots, size(own.coefficients, 1), t)
    return [sum(own.coefficients[k, piece, entry] * of_time[k] for k in eachindex(of_time)) for entry in entries]
end

# A field at a position and a time.
function mmsmith_field(table, X, t, field)
    entries = table.entries[field]
    if table.chart == "points"
        number = mmsmith_point_of(table, X)
        return number === nothing ? fill(NaN, length(entries)) : mmsmith_sum(table.of_points[number], t, entries)
    end
    piece, of_time = mmsmith_moment(table.knots, size(table.coefficients, 2), t)
    basis = mmsmith_along(table, X)
    at(entry) = sum(of_time[k] * sum(table.coefficients[n, k, piece, entry] * basis[n] for n in eachindex(basis)) for k in eachindex(of_time))
    return mmsmith_turned(table, X, table.shapes[field], [at(entry) for entry in entries])
end

# The fields at a position as series in time: b_of_series(own, t) and its like take short sums.
function series(s, X)
    table = table_of(s)
    if table.chart == "points"
        number = mmsmith_point_of(table, X)
        return number === nothing ? Series([0.0, 1.0], fill(NaN, 1, 1, table.entries[end][end])) : table.of_points[number]
    end
    nodes, in_time, pieces, count = size(table.coefficients)
    own = reshape(transpose(reshape(table.coefficients, nodes, :)) * mmsmith_along(table, X), in_time, pieces, count)
    for (shape, entries) in zip(table.shapes, table.entries), piece in 1:pieces, k in 1:in_time
        own[k, piece, entries] = mmsmith_turned(table, X, shape, own[k, piece, entries])
    end
    return Series(table.knots, own)
end

const TABLES = Dict{String,Table}()

# The table of this source, which is read when it is needed first.
table_of(s) = get!(() -> mmsmith_table(TABLE[]), TABLES, TABLE[])
