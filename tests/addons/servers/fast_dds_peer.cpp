// A node in C++ on Fast DDS, ROS 2's default middleware: answers each /scan with a /drive, as test_ros2.py's `steer` does.
// Usage: fast_dds_peer DOMAIN COMMANDS [garbage] [best_effort] [deadline] [reliable]. Prints what it has seen when it has
// sent so many commands, one `key value` a line. garbage: each command comes after bytes that are none; best_effort: of
// the commands; deadline: /imu is asked for with one, which nobody offers; reliable: so are the scans.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

using namespace eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
using eprosima::fastrtps::rtps::SerializedPayload_t;

using Bytes = std::vector<char>;  // the CDR of a message, with its encapsulation

class Raw : public TopicDataType {  // a type of which the samples stay CDR, as rmw_fastrtps has them
public:
    explicit Raw(const std::string& name) {
        setName(name.c_str());
        m_typeSize = 1 << 24;
        m_isGetKeyDefined = false;
        auto_fill_type_information(false);
        auto_fill_type_object(false);
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        const auto& bytes = *static_cast<Bytes*>(data);
        payload->encapsulation = CDR_LE;
        payload->length = bytes.size();
        std::memcpy(payload->data, bytes.data(), bytes.size());
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
        return [data] { return uint32_t(static_cast<Bytes*>(data)->size()); };
    }
    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

struct Listener : DataReaderListener {
    std::function<void(Bytes&)> take;
    void on_data_available(DataReader* reader) override {
        Bytes bytes;
        SampleInfo info;
        while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK)
            if (info.valid_data) take(bytes);
    }
};

struct Node {
    DomainParticipant* participant;
    Publisher* publisher;
    Subscriber* subscriber;
    explicit Node(int domain) {
        participant = DomainParticipantFactory::get_instance()->create_participant(domain, PARTICIPANT_QOS_DEFAULT);
        if (!participant) std::exit(3);
        publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
        subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    }
    Topic* topic(const std::string& name, const std::string& type) {
        TypeSupport support(new Raw(type));
        support.register_type(participant);
        return participant->create_topic(name, type, TOPIC_QOS_DEFAULT);
    }
    DataReader* read(const std::string& name, const std::string& type, bool reliable, bool late, Listener* listener,
                     bool deadline = false) {
        DataReaderQos qos = DATAREADER_QOS_DEFAULT;
        qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
        qos.durability().kind = late ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
        qos.history().kind = KEEP_LAST_HISTORY_QOS;
        qos.history().depth = 5;
        if (deadline) qos.deadline().period = eprosima::fastrtps::Duration_t(0, 10000000);
        qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
        return subscriber->create_datareader(topic(name, type), qos, listener);
    }
    DataWriter* write(const std::string& name, const std::string& type, bool reliable) {
        DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
        qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
        qos.history().depth = 10;
        qos.publish_mode().kind = SYNCHRONOUS_PUBLISH_MODE;
        qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
        return publisher->create_datawriter(topic(name, type), qos);
    }
};

struct Header { int32_t sec; uint32_t nanosec; std::string frame; };

Header header_of(Cdr& cdr) {
    Header header;
    cdr.read_encapsulation();
    cdr >> header.sec >> header.nanosec >> header.frame;
    return header;
}

int main(int argc, char** argv) {
    const int domain = std::atoi(argv[1]), commands = std::atoi(argv[2]);
    const std::set<std::string> options(argv + 3, argv + argc);
    const bool garbage = options.count("garbage");
    Node node(domain);
    std::mutex mutex;
    std::condition_variable changed;
    int sent = 0;
    double x = NAN, y = NAN;
    int poses = 0, early = 0;
    int64_t last = -1;
    uint64_t hash = 14695981039346656037u;  // FNV-1a of the bits of all positions
    size_t map_cells = 0, static_frames = 0, participants = 0;
    std::string names;
    std::vector<double> periods;
    auto before = std::chrono::steady_clock::now();
    const std::string ackermann = "ackermann_msgs::msg::dds_::AckermannDriveStamped_";
    DataWriter* drive = node.write("rt/drive", ackermann, !options.count("best_effort"));
    Listener scans, odometry, maps, mounts, graph;
    graph.take = [&](Bytes& bytes) {
        FastBuffer buffer(bytes.data(), bytes.size());
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        cdr.read_encapsulation();
        std::array<uint8_t, 24> gid;
        uint32_t count = 0;
        cdr >> gid >> count;
        ++participants;
        for (uint32_t i = 0; i < count; ++i) {
            std::string space, name;
            std::vector<std::array<uint8_t, 24>> readers, writers;
            uint32_t gids = 0;
            cdr >> space >> name >> gids;
            for (uint32_t j = 0; j < gids; ++j) cdr >> gid;
            std::lock_guard<std::mutex> guard(mutex);
            names = space + " " + name;
        }
    };
    maps.take = [&](Bytes& bytes) { map_cells = bytes.size(); };
    mounts.take = [&](Bytes& bytes) {
        FastBuffer buffer(bytes.data(), bytes.size());
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        cdr.read_encapsulation();
        uint32_t count;
        cdr >> count;
        static_frames = count;
    };
    odometry.take = [&](Bytes& bytes) {
        FastBuffer buffer(bytes.data(), bytes.size());
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        std::string child;
        Header header = header_of(cdr);
        cdr >> child >> x >> y;
        const int64_t stamp = header.sec * int64_t(1000000000) + header.nanosec;
        if (stamp == last || poses >= commands) return;
        last = stamp;
        ++poses;
        for (double value : {x, y}) {
            unsigned char bits[8];
            std::memcpy(bits, &value, 8);
            for (unsigned char bit : bits) hash = (hash ^ bit) * 1099511628211u;
        }
    };
    scans.take = [&](Bytes& bytes) {
        FastBuffer buffer(bytes.data(), bytes.size());
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        Header header = header_of(cdr);
        float values[7];
        for (float& value : values) cdr >> value;
        std::vector<float> ranges;
        cdr >> ranges;
        double left = 0.0, right = 0.0;
        for (int i = 700; i < 860; ++i) left += std::min(double(ranges[i]), 4.0);
        for (int i = 220; i < 380; ++i) right += std::min(double(ranges[i]), 4.0);
        float angle = float(std::min(std::max(0.6 * (left - right) / 160.0, -0.4), 0.4));
        FastBuffer out;
        Cdr answer(out, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        answer.serialize_encapsulation();
        answer << header.sec << header.nanosec << std::string("base_link") << angle << 0.0f << 2.5f << 0.0f << 0.0f;
        Bytes message(out.getBuffer(), out.getBuffer() + answer.getSerializedDataLength());
        auto now = std::chrono::steady_clock::now();
        periods.push_back(std::chrono::duration<double, std::micro>(now - before).count());
        before = now;
        early += sent < commands && poses != sent + 1;  // a scan that came before the odometry of its tick
        if (garbage) {
            Bytes cut(message.begin(), message.begin() + 4 + sent % (message.size() - 8)), noise(message);
            for (size_t i = 4; i < noise.size(); ++i) noise[i] = char(37 * i + 11 * sent);
            drive->write(&cut);
            if (sent % 3 == 0) noise[12] = noise[13] = noise[14] = noise[15] = char(0xff);  // a length beyond all
            drive->write(&noise);
        }
        std::lock_guard<std::mutex> guard(mutex);
        if (sent < commands && drive->write(&message)) ++sent;
        changed.notify_all();
    };
    node.read("ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_", true, true, &graph);
    node.read("rt/map", "nav_msgs::msg::dds_::OccupancyGrid_", true, true, &maps);
    node.read("rt/tf_static", "tf2_msgs::msg::dds_::TFMessage_", true, true, &mounts);
    node.read("rt/odom", "nav_msgs::msg::dds_::Odometry_", true, false, &odometry);
    if (options.count("deadline")) node.read("rt/imu", "sensor_msgs::msg::dds_::Imu_", true, false, &maps, true);
    node.read("rt/scan", "sensor_msgs::msg::dds_::LaserScan_", options.count("reliable"), false, &scans);
    std::unique_lock<std::mutex> lock(mutex);
    bool done = changed.wait_for(lock, std::chrono::seconds(60), [&] { return sent >= commands; });
    lock.unlock();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    std::sort(periods.begin(), periods.end());
    std::printf("sent %d\nposes %d\nearly %d\nhash %llu\nmap %zu\nmounts %zu\nnode %s\nmedian_us %.0f\n", sent, poses, early, (unsigned long long)hash, map_cells,
                static_frames, names.c_str(), periods.empty() ? 0.0 : periods[periods.size() / 2]);
    std::fflush(stdout);
    std::_Exit(done ? 0 : 1);
}
